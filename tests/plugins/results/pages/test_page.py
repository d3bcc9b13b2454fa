"""The report's page: what a model wrote stays text, and the page needs nothing from elsewhere."""

import json
import re
from html.parser import HTMLParser

import pytest

from plugins.results.report.report_command import report
from tests.core.run_folders import edit, hook, result, write_run

pytestmark = pytest.mark.slow

HOSTILE = "<script>alert(1)</script><img src=x onerror=alert(2)>\"'>{{ 7 * 7 }}</title>$\\frac{1}{2}$\x1b[31m\u202e\x00"


class Page(HTMLParser):
    """Elements and attributes as a browser sees them."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.attributes, self.text = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += [(tag, *attr) for attr in attrs]

    def handle_data(self, data):
        self.text.append(data)


@pytest.fixture(scope="module")
def hostile(tmp_path_factory):
    """A report of a run with texts that are an attack, in a folder with a name that is one."""
    root = tmp_path_factory.mktemp("hostile")
    folder = root / "runs" / "javascript:alert(1) <b>&\"'\x1b[31m\u202e"
    write_run(
        folder,
        rewards=[[0.5], [0.7]],
        tools=[hook(0.2, HOSTILE, HOSTILE)],
        name=HOSTILE,
    )
    bad = write_run(root / "runs" / "<i>bad", rewards=[[0.5]])
    edit(bad, "UPDATE run SET result = ?", json.dumps(result(bad) | {"seed": HOSTILE}))
    report([root / "runs"], root / "out")
    return root / "out"


def test_what_a_model_wrote_stays_text(hostile):
    text = (hostile / "index.html").read_text()
    page = Page(text)
    assert page.tags.count("script") == 2  # the tools' data, and the page's own
    assert all(
        v.startswith("data:image/svg+xml;")
        for tag, key, v in page.attributes
        if key == "src"
    )
    assert not [a for a in page.attributes if a[1].startswith("on")]
    assert "<script>alert" not in text
    assert "{{ 7" in text  # no template of ours read it
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202e]", text)
    assert any("alert(1)" in piece for piece in page.text)


def test_links_stay_inside_files(hostile):
    page = Page((hostile / "index.html").read_text())
    addresses = [
        value for tag, key, value in page.attributes if tag == "a" and key == "href"
    ]
    assert addresses
    for address in addresses:
        assert address.startswith(("#", "data/", "tools/", "../")), address


@pytest.mark.thorough
def test_the_page_needs_nothing_and_says_so(made):
    text = (made[0] / "out" / "index.html").read_text()
    page = Page(text)
    policy = next(
        v for tag, key, v in page.attributes if key == "content" and "default-src" in v
    )
    assert policy.startswith("default-src 'none'; img-src data:; style-src 'sha256-")
    assert "unsafe" not in policy
    loaded = [
        v
        for tag, key, v in page.attributes
        if key in ("src", "srcset", "data", "poster", "xlink:href")
    ]
    loaded += [v for tag, key, v in page.attributes if key == "href" and tag != "a"]
    assert all(address.startswith(("data:", "#")) for address in loaded)
    assert "http://" not in re.sub(
        r'xmlns(:\w+)?="http://www\.w3\.org/[^"]+"', "", text
    )
    # The policy forbids them.
    assert not [a for a in page.attributes if a[1] == "style"]
    identities = [v for _, key, v in page.attributes if key == "id"]
    assert len(identities) == len(set(identities))


def test_tools_that_cannot_be_shown_are_said(tmp_path):
    folder = write_run(tmp_path / "run", rewards=[[0.5]])
    edit(folder, "UPDATE run SET config = replace(config, '\"urdf\"', '\"gone\"')")
    report([folder], tmp_path / "out")
    assert (
        "Tools that can&#39;t be shown: BringCube"
        in (tmp_path / "out" / "index.html").read_text()
    )
