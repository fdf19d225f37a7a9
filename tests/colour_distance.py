"""How far apart two colours are, to normal sight and to dichromats (Machado 2009; CIEDE2000)."""

import numpy as np

# linear sRGB as seen by those without a kind of cones (Machado, Oliveira and Fernandes 2009)
SIGHTS = {
    "normal": np.eye(3),
    "deuteranopia": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
    "protanopia": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
}
_TO_XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)
_WHITE = np.array([0.95047, 1.0, 1.08883])


def linear(rgb):
    """Undo the gamma of (N, 3) uint8 sRGB."""
    share = np.asarray(rgb, np.float64) / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def lab(rgb, sight="normal"):
    """Return (N, 3) CIELAB of sRGB colours as seen with a kind of sight."""
    xyz = np.clip(linear(rgb) @ SIGHTS[sight].T, 0, 1) @ _TO_XYZ.T / _WHITE
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    lightness, a, b = 116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])
    return np.stack([lightness, a, b], axis=1)


def contrast(rgb, ground):
    """Return (N,) contrast of colours to a ground (WCAG): 1 is none, 21 is black on white."""
    first, second = linear(rgb) @ _TO_XYZ[1], float(linear(ground) @ _TO_XYZ[1])
    return (np.maximum(first, second) + 0.05) / (np.minimum(first, second) + 0.05)


def distances(rgb, sight="normal"):
    """Return (N, N) CIEDE2000 between colours as seen with a kind of sight."""
    colours = lab(rgb, sight)
    return delta_e(colours[:, None], colours[None])


def delta_e(first, second):
    """Return CIEDE2000 between CIELAB colours (Sharma, Wu and Dalal 2005); broadcasts."""
    lightness, a, b = np.moveaxis(np.stack(np.broadcast_arrays(first, second)), -1, 0)
    mean_chroma = np.hypot(a, b).mean(axis=0)
    a = a * (1.5 - 0.5 * np.sqrt(mean_chroma**7 / (mean_chroma**7 + 25.0**7)))
    chroma, hue = np.hypot(a, b), np.degrees(np.arctan2(b, a)) % 360
    is_grey = (chroma == 0).any(axis=0)

    # differences
    turn = (hue[1] - hue[0] + 180) % 360 - 180
    turn = np.where(is_grey, 0, np.where(turn == -180, 180, turn))
    d_hue = 2 * np.sqrt(chroma[0] * chroma[1]) * np.sin(np.radians(turn) / 2)
    d_lightness, d_chroma = lightness[1] - lightness[0], chroma[1] - chroma[0]

    # means
    mean_lightness, mean_chroma = lightness.mean(axis=0), chroma.mean(axis=0)
    mean_hue = np.where(is_grey, hue[0] + hue[1], hue[0] + turn / 2) % 360
    weight = sum(
        share * np.cos(np.radians(times * mean_hue + shift))
        for share, times, shift in ((-0.17, 1, -30), (0.24, 2, 0), (0.32, 3, 6), (-0.20, 4, -63))
    )
    off = (mean_lightness - 50) ** 2
    by_lightness = 1 + 0.015 * off / np.sqrt(20 + off)
    by_chroma = 1 + 0.045 * mean_chroma
    by_hue = 1 + 0.015 * mean_chroma * (1 + weight)
    blue = 60 * np.exp(-(((mean_hue - 275) / 25) ** 2))
    twist = -np.sin(np.radians(blue)) * 2 * np.sqrt(mean_chroma**7 / (mean_chroma**7 + 25.0**7))
    parts = d_lightness / by_lightness, d_chroma / by_chroma, d_hue / by_hue
    return np.sqrt(sum(part**2 for part in parts) + twist * parts[1] * parts[2])
