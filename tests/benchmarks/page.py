"""A map as one HTML page in headless Chromium: size, time to open, time of a slider step or turn.

    python -m tests.benchmarks.page [--voxels 500000 1000000] [--run out/]

Drawn in software: a graphics card is faster. A step is timed from the change until a picture that
was begun after it is finished.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median
from time import perf_counter

from playwright.sync_api import sync_playwright

from tests.benchmarks.export import make_run
from tests.pages import CHROMIUM, SOFTWARE_GL

STEP = """async share => {
    const { body } = document;
    const slider = document.getElementById("scan");
    const frame = () => new Promise(requestAnimationFrame);
    await frame();
    const started = performance.now();
    slider.value = Math.max(1, Math.round(slider.max * share));
    slider.dispatchEvent(new Event("input"));
    const tick = () => new Promise(resolve => setTimeout(resolve, 1));
    while (Number(body.dataset.begun) < started) await tick();
    return performance.now() - started;
}"""


def measure(browser, run: Path, page_path: Path) -> dict[str, float]:
    """Export one run and use its page."""
    # written
    started = perf_counter()
    command = [sys.executable, "-m", "mcpseg_cli", "export", str(run), "-o", str(page_path), "-q"]
    subprocess.run(command, check=True)
    exported = perf_counter() - started

    # opened
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    started = perf_counter()
    page.goto(page_path.as_uri())
    page.wait_for_selector('body[data-state="ready"]', state="attached", timeout=120_000)
    opened = perf_counter() - started

    # used, after it has come to rest
    page.wait_for_timeout(3000)
    shares = (0.1, 0.3, 0.5, 0.7, 0.9, 0.2, 0.4, 0.6, 0.8, 1.0)
    steps = [page.evaluate(STEP, share) for share in shares]
    page.wait_for_timeout(3000)
    turns = [turn(page, pixels) for pixels in range(10, 110, 10)]
    page.close()

    size = page_path.stat().st_size / 1e6
    return {
        "size_mb": size,
        "export_s": exported,
        "open_s": opened,
        "slider_ms": median(steps),
        "slider_most_ms": max(steps),
        "turn_ms": median(turns),
    }


def turn(page, pixels: int) -> float:
    """Drag the view a little; return the milliseconds until two more frames were drawn."""
    page.mouse.move(700, 400)
    page.mouse.down()
    started = perf_counter()
    page.mouse.move(700 + pixels, 400)
    page.evaluate(
        "async () => { for (let i = 0; i < 2; i++) await new Promise(requestAnimationFrame); }"
    )
    elapsed = 1e3 * (perf_counter() - started)
    page.mouse.up()
    return elapsed


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--voxels", type=int, nargs="+", default=[500_000, 1_000_000])
    parser.add_argument(
        "--run", type=Path, nargs="*", default=[], help="folders that 'mcpseg segment' wrote"
    )
    arguments = parser.parse_args()
    if CHROMIUM is None:
        sys.exit("no Chromium on this machine (Debian: apt-get install chromium)")

    with tempfile.TemporaryDirectory() as name, sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE_GL)
        runs = {str(run): run for run in arguments.run}
        for voxels in arguments.voxels:
            folder = Path(name) / str(voxels)
            make_run(folder, voxels)
            runs[f"{voxels:,} voxels"] = folder

        for title, run in runs.items():
            figures = measure(browser, run, Path(name) / "map.html")
            (Path(name) / "map.html").unlink()
            print(title, {key: round(value, 2) for key, value in figures.items()}, flush=True)
            if run.parent == Path(name):
                shutil.rmtree(run)


if __name__ == "__main__":
    main()
