"""A headless Chromium for tests of pages: `opened` skips, with a reason, where there is none."""

import base64
import io
import json
import shutil
import tempfile
from contextlib import contextmanager

import numpy as np
import pytest
from PIL import Image

FLAGS = (
    *(
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-quic",
        "--no-first-run",
        "--hide-scrollbars",
    ),
    *(
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
    ),
    *("--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
)


@contextmanager
def opened(page, width=1200, height=900, *, dark=False):
    """A driver that shows a page's file, its logs emptied of what came before."""
    webdriver = pytest.importorskip(
        "selenium.webdriver", reason="selenium is not installed"
    )
    browser, driver = (
        shutil.which("chromium") or shutil.which("google-chrome"),
        shutil.which("chromedriver"),
    )
    if browser is None or driver is None:
        pytest.skip("there is no chromium with its chromedriver on this machine")
    options = webdriver.ChromeOptions()
    options.binary_location = browser
    options.set_capability(
        "goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"}
    )
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        for flag in (*FLAGS, f"--user-data-dir={profile}"):
            options.add_argument(flag)
        chrome = webdriver.Chrome(
            options=options, service=webdriver.ChromeService(driver)
        )
        try:
            chrome.get("about:blank")
            size = {
                "width": width,
                "height": height,
                "deviceScaleFactor": 1,
                "mobile": width < 600,
            }
            chrome.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
            scheme = {
                "name": "prefers-color-scheme",
                "value": "dark" if dark else "light",
            }
            chrome.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
            for log in ("browser", "performance"):
                chrome.get_log(log)
            chrome.get(page.resolve().as_uri())
            yield chrome
        finally:
            chrome.quit()


def complaints(chrome):
    """What the console says, a violation of the page's policy among it; but not that drawing without a GPU is slow."""
    said = [entry["message"] for entry in chrome.get_log("browser")]
    return [
        message
        for message in said
        if "GL Driver Message (OpenGL, Performance" not in message
    ]


def requests(chrome):
    """Addresses that were asked for, but for those that hold their content."""
    events = (
        json.loads(entry["message"])["message"]
        for entry in chrome.get_log("performance")
    )
    asked = [
        e["params"]["request"]["url"]
        for e in events
        if e["method"] == "Network.requestWillBeSent"
    ]
    return [
        address
        for address in asked
        if not address.startswith(("data:", "chrome:", "chrome-untrusted:"))
    ]


def screenshot(chrome, element=None):
    """Pixels (H, W, 3) of the window, or of an element."""
    png = (
        element.screenshot_as_png
        if element is not None
        else base64.b64decode(chrome.get_screenshot_as_base64())
    )
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))
