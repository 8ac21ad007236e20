"""Hooks of properdocs.yml: which files the site has, and where links to files of the repository lead."""

import posixpath
import re
import subprocess
from pathlib import Path
from urllib.parse import quote, unquote

from properdocs.exceptions import PluginError
from properdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[1]
ON_SITE = ("*.md", "docs", "reports", ":!pipeline", ":!tactile", ":!tests", ":!reports/metrics")
LINK = re.compile(r'<a ([^>]*)href="([^"#:]+)(#[^"]*)?"([^>]*)>(.*?)</a>', re.DOTALL)
HOME = '<ul><li><a href="../README.md">The project</a></li>'


def on_files(files: Files, config) -> Files:
    """Lay the site out as the repository, of what git has there: a run leaves more in reports/."""
    listed = subprocess.run(["git", "ls-files", "-z", *ON_SITE], cwd=ROOT, capture_output=True, text=True, check=True)
    names = listed.stdout.strip("\0").split("\0")
    theme = [one for one in files if one.src_dir != config.docs_dir]
    site = Files([*theme, *(File.generated(config, name, abs_src_path=str(ROOT / name)) for name in names)])
    for name in names:
        if name.endswith(".html"):  # a page of its own, with contents that are its first list
            page = site.src_uris[name]
            page.content_string = led(page.content_string.replace("<ul>", HOME, 1), name, config, site)
    return site


def on_page_content(html: str, page, config, files: Files) -> str:
    """Lead the links of a document; those to pages lead there already."""
    return led(html, page.file.src_uri, config, files)


def led(html: str, name: str, config, site: Files) -> str:
    """Return a page whose links to documents lead to their pages, and those to files that the site lacks to the host.

    Where the host is not known (`repo_url`), the latter are plain text.
    """
    pages, folder = {one.src_uri: one.dest_uri for one in site}, posixpath.dirname(name)

    def lead(found: re.Match) -> str:
        before, target, place, after, text = found.groups(default="")
        path = posixpath.normpath(posixpath.join(folder, unquote(target)))
        if path in pages.values():
            return found[0]
        if path in pages:
            address = quote(posixpath.relpath(pages[path], folder)) + place
        elif not (ROOT / path).exists():
            raise PluginError(f"{name} links to {target}, which is not there")
        elif config.repo_url:
            address = f"{config.repo_url.rstrip('/')}/blob/HEAD/{quote(path)}{place}"
        else:
            return text
        return f'<a {before}href="{address}"{after}>{text}</a>'

    return LINK.sub(lead, html)
