"""Check the links of a built site: every file, and every anchor in it, must be there.

Run from anywhere: python docs/check_links.py FOLDER (make docs does).
"""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """The anchors of a page and what it links to."""

    def __init__(self) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.anchors |= {value for key in ("id", "name") if (value := values.get(key))}
        self.links += [value for key in ("href", "src") if (value := values.get(key)) and tag != "base"]


def broken(folder: Path) -> list[str]:
    """Return the links that lead nowhere, with their pages."""
    pages = {}
    for file in sorted(folder.rglob("*.html")):
        if "_static" in file.parts:  # templates of the theme
            continue
        pages[file.resolve()] = page = Page()
        page.feed(file.read_text(encoding="utf-8"))
    found = []
    for file, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (file.parent / unquote(parts.path)).resolve() if parts.path else file
            anchor = unquote(parts.fragment)
            if not target.is_file():
                found.append(f"{file.relative_to(folder.resolve())}: {link}: no such file")
            elif anchor and target in pages and anchor not in pages[target].anchors:
                found.append(f"{file.relative_to(folder.resolve())}: {link}: no such anchor")
    return found


def main() -> int:
    folder = Path(sys.argv[1])
    found = broken(folder)
    print("\n".join(found) or f"{len(list(folder.rglob('*.html')))} pages: every link leads somewhere")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
