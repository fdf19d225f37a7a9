"""The README as package indexes show it: links and pictures with whole addresses."""

import re
from pathlib import Path

from hatchling.metadata.plugin.interface import MetadataHookInterface

PAGES = "https://github.com/OWNER/mcpseg/blob/main/"
FILES = "https://raw.githubusercontent.com/OWNER/mcpseg/main/"


class WholeAddresses(MetadataHookInterface):
    """Gives the package its README."""

    def update(self, metadata: dict) -> None:
        """Put the README into the metadata."""
        text = whole_addresses((Path(self.root) / "README.md").read_text(encoding="utf-8"))
        metadata["readme"] = {"content-type": "text/markdown", "text": text}


def whole_addresses(text: str) -> str:
    """Replace what is relative to the repository."""
    text = re.sub(r"(!\[[^]]*\]\()(?!https?:|#)", rf"\g<1>{FILES}", text)
    return re.sub(r"((?<!!)\[[^]]*\]\()(?!https?:|#)", rf"\g<1>{PAGES}", text)
