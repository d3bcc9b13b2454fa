"""The report's page in a browser: quiet, self-contained, on a phone and in the dark; tables sort, tools turn."""

import numpy as np
import pytest
from PIL import ImageColor

from plugins.results.report.report_command import report
from tests.core.browser import complaints, opened, requests, screenshot
from tests.core.run_folders import hook, write_run

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    root = tmp_path_factory.mktemp("browser")
    for task, best in (("BringCube", 0.7), ("MoveBall", 0.9), ("OneBook", 0.8)):
        for seed in (0, 1):
            rewards = [[0.3, 0.4], [0.5, best - 0.1 * seed]]
            tools = [hook(0.2, f"short {task}"), hook(0.5, f"long {task}")]
            write_run(
                root / "runs" / f"{task}{seed}",
                f"task={task}",
                f"seed={seed}",
                rewards=rewards,
                tools=tools,
            )
    write_run(root / "runs" / "sampled", "evolution=sampling", rewards=[[0.35]])
    write_run(root / "runs" / "killed", "seed=2", finish=False)
    report([root / "runs"], root / "out")
    return root / "out" / "index.html"


@pytest.fixture(scope="module")
def chrome(page):
    with opened(page) as driver:
        yield driver


def column(chrome, table, number):
    script = (
        "return Array.from(document.querySelectorAll(`#table-${arguments[0]} tbody tr`))\
.filter((row) => !row.hidden).map((row) => row.cells[arguments[1]].textContent)"
    )
    return chrome.execute_script(script, table, number)


def press(chrome, table, number):
    chrome.execute_script(
        "document.querySelectorAll(`#table-${arguments[0]} thead button`)[arguments[1]].click()",
        table,
        number,
    )


@pytest.mark.thorough
def test_it_asks_for_nothing_and_the_browser_keeps_its_policy(page):
    with opened(page) as chrome:
        assert complaints(chrome) == []
        assert requests(chrome) == [page.resolve().as_uri()]
        chrome.execute_script(
            "document.body.innerHTML += '<img src=https://127.0.0.1:9/x><p onclick=1 style=top:0>'"
        )
        said = " ".join(complaints(chrome))
        assert "img-src" in said
        assert "style-src" in said


@pytest.mark.thorough
def test_tables_sort(chrome):
    press(chrome, "runs", 3)  # the best reward: the greatest first
    rewards = [float(text) for text in column(chrome, "runs", 3)]
    assert rewards == sorted(rewards, reverse=True)
    assert len(rewards) == 7
    press(chrome, "runs", 3)
    assert [float(text) for text in column(chrome, "runs", 3)] == sorted(rewards)
    press(chrome, "runs", 0)
    tasks = column(chrome, "runs", 0)
    assert tasks == sorted(tasks)
    heads = chrome.execute_script(
        "return Array.from(document.querySelectorAll('#table-runs th')).map((h) => h.getAttribute('aria-sort'))"
    )
    assert heads[0] == "ascending"
    assert not any(heads[1:])


def test_a_tool_is_drawn_and_turns(chrome):
    canvas = chrome.find_element("css selector", ".viewer canvas")
    chrome.execute_script("arguments[0].scrollIntoView()", canvas)
    first = screenshot(chrome, canvas).astype(int)
    ground = first[5, 5]
    drawn = np.abs(first - ground).sum(axis=-1) > 30
    assert 0.01 < drawn.mean() < 0.6
    assert (first[..., 2] > first[..., 0] + 60).any()  # the blue of the tool
    canvas.send_keys("\ue012" * 5)  # the left arrow
    turned = screenshot(chrome, canvas).astype(int)
    assert (np.abs(turned - first).sum(axis=-1) > 30).mean() > 0.01
    chrome.find_element("css selector", ".viewer button").click()
    assert np.abs(screenshot(chrome, canvas).astype(int) - first).mean() < 0.5
    from selenium.webdriver import ActionChains

    ActionChains(chrome).drag_and_drop_by_offset(canvas, 120, 0).perform()
    assert (
        np.abs(screenshot(chrome, canvas).astype(int) - first).sum(axis=-1) > 30
    ).mean() > 0.01


@pytest.mark.parametrize("dark", [False, True])
def test_on_a_phone_the_page_does_not_scroll_sideways(page, dark):
    with opened(page, 390, 844, dark=dark) as chrome:
        width, window = chrome.execute_script(
            "return [document.documentElement.scrollWidth, innerWidth]"
        )
        assert (width, window) == (390, 390)
        assert complaints(chrome) == []
        colours = chrome.execute_script(
            "const s = getComputedStyle(document.body); return [s.backgroundColor, s.color]"
        )
        ground, ink = (np.array(ImageColor.getrgb(colour)) for colour in colours)
        assert (ground.mean() < 60) == dark
        assert abs(ground.mean() - ink.mean()) > 150
        assert (screenshot(chrome).mean() < 100) == dark
