"""The site of documents and reports: it builds without a warning, and every link leads somewhere, in a browser, too."""

import functools
import os
import subprocess
import sys
import threading
from html.parser import HTMLParser
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from builders.project import ROOT

pytestmark = pytest.mark.slow

HOST = "https://host.example/us/tactile"
RESULTS = Path("reports/index.html")


class Page(HTMLParser):
    """Collects the links and ids of a page."""

    def __init__(self, path: Path):
        super().__init__()
        self.links, self.ids = [], []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.links += [values[key] for key in ("href", "src") if values.get(key)]
        self.ids += [values["id"]] if "id" in values else []


def built(folder: Path, host: str) -> Path:
    """Build the site in a folder, with links to the files of that host."""
    command = [sys.executable, "-m", "properdocs", "build", "--strict", "--site-dir", str(folder)]
    variables = os.environ | {"SITE_REPOSITORY": host, "SITE_URL": ""}
    done = subprocess.run(command, cwd=ROOT, env=variables, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return folder


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    return built(tmp_path_factory.mktemp("site"), "")


@pytest.fixture(scope="module")
def pages(site) -> dict[Path, Page]:
    return {path.relative_to(site): Page(path) for path in site.rglob("*.html")}


def inside(page: Path, address: str) -> Path:
    """Return the path, in the site, of what a page calls `address`."""
    path = unquote(urlsplit(address).path)
    return Path(os.path.normpath(page.parent / path if not path.startswith("/") else path[1:])) if path else page


def test_every_link_leads_somewhere(site, pages):
    tracked = subprocess.run(["git", "ls-files", "*.md", "*.html"], cwd=ROOT, capture_output=True, text=True).stdout
    documents = [Path(one) for one in tracked.split() if not one.startswith(("pipeline/", "tactile/", "tests/"))]
    names = [one.with_name(one.name.replace("README.md", "index.html")).with_suffix(".html") for one in documents]
    assert RESULTS in names and set(names) <= set(pages)
    wrong = []
    for page, found in pages.items():
        for link in found.links:
            if urlsplit(link).scheme:
                continue
            target, place = inside(page, link), unquote(urlsplit(link).fragment).partition("?")[0]
            if not (site / target).is_file() or (place and place not in pages[target].ids):
                wrong.append((str(page), link))
    assert not wrong


def test_results_are_one_click_from_the_home_page(pages):
    home = Path("index.html")
    assert RESULTS in {inside(home, link) for link in pages[home].links}
    assert "answers" in pages[RESULTS].ids
    assert home in {inside(RESULTS, link) for link in pages[RESULTS].links}, "and there is a way back"


def test_no_file_names_a_place_of_this_machine(site):
    texts = [path for path in site.rglob("*") if path.suffix in {".html", ".json", ".xml", ".js", ".css"}]
    assert len(texts) > 50
    for path in texts:
        text = path.read_text(encoding="utf-8")
        assert not any(str(place) in text for place in (ROOT, site)), path


def test_links_to_other_files_lead_to_the_host(pages, tmp_path):
    assert not [link for page in pages.values() for link in page.links if HOST in link]
    site = built(tmp_path / "site", HOST)
    hosted = {link for path in site.rglob("*.html") for link in Page(path).links if link.startswith(f"{HOST}/")}
    files = {link.removeprefix(f"{HOST}/blob/HEAD/") for link in hosted}
    assert {"LICENSE", "params.yaml", "evidence/shards.yaml"} <= files
    assert all((ROOT / unquote(path)).exists() for path in files)


@pytest.fixture
def address(site):
    """Serve the site on this machine: a page that is read as a file may start no search."""

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *values):
            """Say nothing of each request."""

    with ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=site)) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
        thread.join()


def test_browser_fits_every_page_without_complaint(tab, address, pages):
    home = Path("index.html")
    for width, shown in ((390, sorted(pages)), (1400, [home])):
        tab.width(width)
        for page in shown:
            tab.open(f"{address}/{page.as_posix()}")
            assert tab.run("document.scrollingElement.scrollWidth") <= width, page
            assert tab.problems == [], page
            assert all(one.startswith((address, "data:")) for one in tab.requests), f"{page}: nothing from elsewhere"
