"""The report in a real browser: nothing is fetched, nothing fails, tables sort."""

import base64
import json
import shutil

import pytest

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(
        not (shutil.which("chromium") and shutil.which("chromedriver")), reason="needs chromium and chromedriver"
    ),
]


@pytest.fixture(scope="module")
def page(solved_folder):
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1300,900"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
    driver.set_page_load_timeout(60)
    yield driver, solved_folder
    driver.quit()


def fresh(page, path="index.html"):
    """Open a page anew; a busy browser may still show the blank one when it says that the page is loaded."""
    from selenium.webdriver.support.ui import WebDriverWait

    driver, folder = page
    driver.get_log("browser")
    driver.get_log("performance")
    driver.get("about:blank")  # without it the same address would keep its open sections
    driver.get((folder / path).as_uri())
    loaded = "return location.protocol === 'file:' && document.readyState === 'complete'"
    WebDriverWait(driver, 60).until(lambda _: driver.execute_script(loaded))
    return driver


def requests(driver):
    events = (json.loads(entry["message"])["message"] for entry in driver.get_log("performance"))
    return [event["params"]["request"]["url"] for event in events if event["method"] == "Network.requestWillBeSent"]


def test_no_error_and_no_request_beyond_the_folder(page):
    driver = fresh(page)
    assert driver.execute_script("return document.documentElement.dataset.ready") == "true"
    assert driver.get_log("browser") == []
    asked = requests(driver)
    assert any(url.endswith("report.js") for url in asked)
    assert [url for url in asked if not url.startswith(("file:", "data:"))] == []


def test_a_broken_page_would_be_noticed(page):
    _, folder = page
    text = (folder / "index.html").read_text()
    broken = text.replace("report.js", "http://127.0.0.1:9/report.js")
    (folder / "broken.html").write_text(broken)
    driver = fresh(page, "broken.html")
    assert driver.execute_script("return document.documentElement.dataset.ready") is None
    assert driver.get_log("browser")
    assert any(url.startswith("http:") for url in requests(driver))


def test_figures_are_drawn(page):
    driver = fresh(page)
    for name in ("psf-plot", "texel-plot", "campaign-plot"):
        assert driver.execute_script(f"return document.querySelectorAll('#{name} svg').length") > 0


def column(driver, index):
    script = "return [...document.querySelectorAll('#case-table tbody tr')].map(r => r.cells[arguments[0]].textContent)"
    return [text.strip() for text in driver.execute_script(script, index)]


@pytest.mark.parametrize("index", [0, 4])
def test_tables_sort_both_ways(page, index):
    driver = fresh(page)
    before = column(driver, index)
    key = float if index else str
    header = driver.find_elements("css selector", "#case-table thead th")[index]
    driver.execute_script("arguments[0].click()", header)
    assert column(driver, index) == sorted(before, key=key)
    driver.execute_script("arguments[0].click()", header)
    assert column(driver, index) == sorted(before, key=key, reverse=True)
    assert header.get_attribute("aria-sort") == "descending"


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1300])
def test_nothing_keeps_a_reader_out(page, scheme, width):
    """axe-core finds no serious or critical fault, on a phone and on a desk, in light and in dark."""
    driver = page[0]
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    driver.execute_cdp_cmd(
        "Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
    )
    try:
        driver = fresh(page)
        driver.find_element("id", "unfold").click()
        assert count_open(driver) == count_sections(driver) > 10
        assert driver.execute_script("return matchMedia('(prefers-color-scheme: dark)').matches") == (scheme == "dark")
        assert list_barriers(driver) == []
    finally:
        driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def count_sections(driver):
    return len(driver.find_elements("css selector", "details"))


def count_open(driver):
    return len(driver.find_elements("css selector", "details[open]"))


@pytest.mark.parametrize(("width", "height"), [(390, 844), (1300, 900)])
def test_the_folded_page_is_three_screens_long_and_not_too_wide(page, width, height):
    driver = page[0]
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < height}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        driver = fresh(page)
        assert count_open(driver) == 0
        long, wide = driver.execute_script("return [document.body.scrollHeight, document.body.scrollWidth]")
        assert long <= 3 * height
        assert wide <= width
        verdict = driver.find_element("id", "verdict-title").rect
        assert verdict["y"] + verdict["height"] < height / 2
    finally:
        driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_a_link_into_a_section_opens_it(page):
    from selenium.webdriver.support.ui import WebDriverWait

    driver = fresh(page)
    driver.execute_script("location.hash = '#codes'")  # a table in a section
    WebDriverWait(driver, 5).until(lambda _: count_open(driver) == 1)
    assert driver.find_element("css selector", "details[open]").get_attribute("id") == "verification"
    assert driver.find_element("id", "codes").is_displayed()


def test_a_key_opens_a_section(page):
    driver = fresh(page)
    summary = driver.find_element("css selector", "#limits summary")
    summary.send_keys("\n")
    assert driver.find_element("id", "limits").get_attribute("open") is not None


def test_a_print_unfolds_what_is_folded_and_folds_it_again(page):
    driver = fresh(page)
    driver.execute_script("dispatchEvent(new Event('beforeprint'))")
    assert count_open(driver) == count_sections(driver)
    driver.execute_script("dispatchEvent(new Event('afterprint'))")
    assert count_open(driver) == 0
    pages = [driver.execute_cdp_cmd("Page.printToPDF", {})["data"]]
    driver.execute_script("for (const each of document.querySelectorAll('details')) each.remove()")
    pages.append(driver.execute_cdp_cmd("Page.printToPDF", {})["data"])
    counts = [base64.b64decode(each).count(b"/Type /Page\n") for each in pages]
    assert counts[0] > counts[1] + 3


def test_a_barrier_would_be_noticed(page):
    driver = fresh(page)
    driver.execute_script(
        "document.querySelector('main, body').insertAdjacentHTML('beforeend', '<img src=\"data:,\">')"
    )
    assert [barrier["id"] for barrier in list_barriers(driver)] == ["image-alt"]


def list_barriers(driver):
    """What axe-core calls serious or critical, with the first element of each."""
    from axe_core_python.selenium import Axe

    return [
        {"id": each["id"], "where": each["nodes"][0]["html"][:200], "count": len(each["nodes"])}
        for each in Axe().run(driver)["violations"]
        if each["impact"] in {"serious", "critical"}
    ]


def test_tables_on_a_desk_are_whole_and_break_no_word(page):
    driver = page[0]
    size = {"width": 1300, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        driver = fresh(page)
        driver.find_element("id", "unfold").click()
        cut = "return [...document.querySelectorAll('.card')].filter(c => c.scrollWidth > c.clientWidth).length"
        assert driver.execute_script(cut) == 0
    finally:
        driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
