"""A built book: `book.py links FOLDER` follows its links, `book.py look FOLDER PICTURES` opens it in Chromium. One JSON document each.

Links: every href and src of every page leads to a file of the book, and to an anchor in it. Addresses elsewhere are listed, not asked.
Look: pages from the disk, light, dark and narrow; what asks for anything from elsewhere; whether equations have a size; what the search finds.
"""
import json
import shutil
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Links(HTMLParser):
    def __init__(self):
        super().__init__()
        self.links, self.names = [], set()

    def handle_starttag(self, tag, attributes):
        facts = dict(attributes)
        self.names.update(facts[key] for key in ("id", "name") if facts.get(key))
        self.links += [facts[key] for key in ("href", "src") if facts.get(key)]


def links(book):
    pages = {}
    for path in sorted(book.rglob("*.html")):
        pages[path] = Links()
        pages[path].feed(path.read_text())
    broken, elsewhere, within = [], set(), 0
    for path, page in pages.items():
        # The page to print holds every chapter with its links taken from its own folder; 404.html is meant for a server's root.
        if path.name in ("print.html", "404.html"):
            continue
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme in ("http", "https", "mailto"):
                elsewhere.add(link)
                continue
            if parts.scheme:
                continue
            within += 1
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            anchor = unquote(parts.fragment)
            if not target.is_file():
                broken.append(f"{path.relative_to(book)}: {link}")
            elif anchor and target in pages and anchor not in pages[target].names:
                broken.append(f"{path.relative_to(book)}: {link}: no such anchor")
    return {"pages": len(pages), "within": within, "broken": broken, "elsewhere": sorted(elsewhere)}


# Pages that are looked at, and what the search is asked.
PAGES = ["introduction", "tutorial/first-run", "tutorial/first-rig", "tutorial/own-data", "physics/spring-slider", "physics/psi", "statistics/verdict", "commands", "safety-case"]
ASKED = ["ridge penalty", "pseudo-terminal", "e-process"]
WITHIN_MS = 180_000
LOOK = """() => ({
  wide: document.documentElement.scrollWidth - document.documentElement.clientWidth,
  equations: [...document.querySelectorAll('main math')].map(m => m.getBoundingClientRect()).map(r => [r.width, r.height]),
})"""


def look(book, pictures):
    from axe_playwright_python.sync_playwright import Axe
    from playwright.sync_api import sync_playwright

    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if not chromium:
        sys.exit("chromium is missing: tests/venv installs it")
    seen = {"asked": [], "errors": [], "wide": [], "flat": [], "equations": 0, "axe": [], "found": {}}
    axe = Axe()
    with sync_playwright() as p:
        browser = p.chromium.launch(executable_path=chromium, timeout=WITHIN_MS, args=["--no-sandbox", "--disable-gpu"])
        for scheme, width in [("light", 1280), ("dark", 1280), ("light", 400)]:
            page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
            page.set_default_timeout(WITHIN_MS)
            page.on("request", lambda r: seen["asked"].append(r.url) if not r.url.startswith((book.as_uri(), "data:")) else None)
            page.on("console", lambda m: seen["errors"].append(m.text) if m.type == "error" else None)
            page.on("pageerror", lambda e: seen["errors"].append(str(e)))
            for name in PAGES:
                page.goto((book / f"{name}.html").as_uri())
                page.wait_for_load_state("load")
                said = page.evaluate(LOOK)
                at = f"{name} {scheme} {width}"
                if said["wide"] > 0:
                    seen["wide"].append(f"{at}: {said['wide']} px")
                seen["flat"] += [f"{at}: {size}" for size in said["equations"] if min(size) < 3]
                if (scheme, width) == ("light", 1280):
                    seen["equations"] += len(said["equations"])
                    seen["axe"] += [
                        f"{at}: {v['id']}: {v['nodes'][0]['target']}"
                        for v in axe.run(page, context="main", options={"preload": False}).response["violations"]
                        if v["impact"] in ("serious", "critical")
                    ]
                page.screenshot(path=pictures / f"{name.replace('/', '-')}-{scheme}-{width}.png")
            if width > 1000 and scheme == "light":
                for asked in ASKED:
                    page.goto((book / "introduction.html").as_uri())
                    page.keyboard.press("s")
                    page.wait_for_selector("#mdbook-searchbar:visible, #searchbar:visible")
                    page.keyboard.type(asked)
                    page.wait_for_selector("#mdbook-searchresults li a, #searchresults li a")
                    page.wait_for_timeout(500)
                    seen["found"][asked] = page.eval_on_selector_all("#mdbook-searchresults li a, #searchresults li a", "all => all.map(a => a.href)")
                    page.screenshot(path=pictures / f"search-{asked.replace(' ', '-')}.png")
            page.close()
        browser.close()
    return seen


book = Path(sys.argv[2]).resolve()
print(json.dumps(links(book) if sys.argv[1] == "links" else look(book, Path(sys.argv[3]))))
