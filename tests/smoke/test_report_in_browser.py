"""The report's page in a real browser: nothing complains, tables sort, images load, no overflow."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from run_records import metrics, records, write_records, write_run

from p2gd_fgo.report.pages.write import write_report

if TYPE_CHECKING:
    from playwright.sync_api import Browser

playwright = pytest.importorskip("playwright.sync_api", reason="playwright isn't installed")

NAMES = ("chromium", "chromium-browser", "google-chrome")
BROWSER = next((path for path in map(shutil.which, NAMES) if path), None)
pytestmark = pytest.mark.skipif(
    BROWSER is None, reason="no chromium and no google-chrome on the PATH"
)

CELLS = "rows => rows.map(row => Array.from(row.cells, cell => cell.textContent.trim()))"


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A page of run directories, and one of a study with a run that failed."""
    root = tmp_path_factory.mktemp("reports")
    for distribution, noise in (("grid", 0.02), ("p2gd", 0.01)):
        write_run(root / "runs" / distribution, distribution__kind=distribution, noise_m=noise)
    made = records(routes=3, seeds=2)
    made[0] = replace(made[0], status="failed", reason="<b>diverged</b>")
    made[1] = replace(made[1], metrics=metrics(1.0, 1.0, 1.0, completeness=0.3))
    write_records(root / "study" / "results.jsonl", made)
    return {
        name: write_report([root / name], html=root / f"{name}.html").files[0]
        for name in ("runs", "study")
    }


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with playwright.sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        yield started
        started.close()


class Opened:
    """A page as a reader opens it, offline, with all that it complains of."""

    def __init__(self, browser: Browser, path: Path, width: int) -> None:
        context = browser.new_context(viewport={"width": width, "height": 900}, offline=True)
        self.complaints: list[str] = []
        self.asked: list[str] = []
        self.page = context.new_page()
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("dialog", lambda dialog: self.complaints.append(dialog.message))
        self.page.on("request", lambda request: self.asked.append(request.url[:60]))
        self.page.goto(path.as_uri())

    def rows(self, table: str) -> list[list[str]]:
        found = self.page.eval_on_selector_all(f"#{table} + p + div tbody.rows tr", CELLS)
        return [[str(cell) for cell in row] for row in found]


@pytest.mark.parametrize("width", [1400, 390])
@pytest.mark.parametrize("name", ["runs", "study"])
def test_opens_without_complaint_in_any_width(
    browser: Browser, pages: dict[str, Path], name: str, width: int
) -> None:
    opened = Opened(browser, pages[name], width)
    assert opened.complaints == []
    assert [url for url in opened.asked if not url.startswith("data:")] == [
        pages[name].as_uri()[:60]
    ]
    assert opened.page.evaluate("document.documentElement.scrollWidth") <= width
    loaded = opened.page.eval_on_selector_all(
        "img", "images => images.map(i => i.complete && i.naturalWidth > 500)"
    )
    assert len(loaded) >= 5 and all(loaded)


def test_tables_sort_by_number_and_by_text(browser: Browser, pages: dict[str, Path]) -> None:
    opened = Opened(browser, pages["study"], 1400)
    button = opened.page.locator("#runs-runs + p + div th", has_text="ATE m").locator("button")
    before = opened.rows("runs-runs")
    column = 4
    button.click()
    rising = [float(row[column]) for row in opened.rows("runs-runs")]
    assert rising == sorted(rising) and rising != [float(row[column]) for row in before]
    button.click()
    assert [float(row[column]) for row in opened.rows("runs-runs")] == rising[::-1]
    heads = opened.page.locator("#runs-runs + p + div th[aria-sort]")
    assert heads.count() == 1 and heads.get_attribute("aria-sort") == "descending"
    opened.page.locator("#runs-runs + p + div th", has_text="status").locator("button").click()
    states = [row[8] for row in opened.rows("runs-runs")]
    assert states == sorted(states, key=str.lower) and "FAILED" in states
    assert sorted(opened.rows("runs-runs")) == sorted(before)
    assert opened.complaints == []


def test_what_is_unknown_comes_last_and_the_summary_stays(
    browser: Browser, pages: dict[str, Path]
) -> None:
    opened = Opened(browser, pages["study"], 1400)
    table = "accuracy-absolute"
    foot = opened.page.locator(f"#{table} + p + div tfoot").inner_text()
    for _ in range(2):
        opened.page.locator(f"#{table} + p + div th button").nth(1).click()
        column = [row[1] for row in opened.rows(table)]
        assert "–" not in column[:-1]
    assert opened.page.locator(f"#{table} + p + div tfoot").inner_text() == foot
    assert foot.startswith("RMS")


def test_a_reason_is_text(browser: Browser, pages: dict[str, Path]) -> None:
    opened = Opened(browser, pages["study"], 1400)
    alarm = opened.page.locator(".alarm").first
    assert "<b>diverged</b>" in alarm.inner_text()
    box = alarm.bounding_box()
    assert box is not None and box["y"] < 400
