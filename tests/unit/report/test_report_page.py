"""The page holds all it shows, says what went wrong, and takes names as text."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import pytest
from matplotlib.image import imread
from rich.console import Console
from run_records import metrics, record, records, write_records, write_run

from p2gd_fgo.errors import ConfigError
from p2gd_fgo.report.pages.build import build_report
from p2gd_fgo.report.pages.sources import find_runs
from p2gd_fgo.report.pages.write import write_report

NASTY = "<script>alert(1)</script>|a_b & 50 % $x$ {y}"


class Page(HTMLParser):
    """Tags with their attributes, and the text outside script and style."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.texts: list[str] = []
        self._open: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, {key: value or "" for key, value in attrs}))
        self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        while self._open and self._open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if not {"script", "style"} & set(self._open):
            self.texts.append(data)

    def all(self, tag: str) -> list[dict[str, str]]:
        return [attributes for name, attributes in self.tags if name == tag]

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.texts).split())


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two methods with two seeds each, and one that failed, in folders with nasty names."""
    root = tmp_path_factory.mktemp("runs")
    for seed in (0, 1):
        for distribution in ("grid", "p2gd"):
            folder = root / f"{distribution} {seed} & 50 % #?"
            write_run(folder, seed=seed, distribution__kind=distribution, noise_m=0.02 + seed / 50)
    write_run(root / "broken", failed=f"diverged: {NASTY}", distribution__kind="anms")
    return root


@pytest.fixture(scope="module")
def written(runs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of these runs, in a folder that had to be made."""
    path = tmp_path_factory.mktemp("page") / "deep" / "report.html"
    assert write_report([runs], html=path).files == (path, path.parent / "report_figures")
    return path


def test_needs_nothing_from_outside(written: Path) -> None:
    page = Page(written)
    text = written.read_text(encoding="utf-8")
    assert not re.search(r"""(src|href)=["']?(https?:|//)|@import|url\(""", text)
    assert len(page.all("script")) == 1 and "src" not in page.all("script")[0]
    for image in page.all("img"):
        assert image["src"].startswith("data:image/png;base64,")
        assert image["alt"] and int(image["width"]) > 300
    assert len(page.all("img")) >= 5


def test_every_link_leads_somewhere(runs: Path, written: Path) -> None:
    page = Page(written)
    links = [a["href"] for a in page.all("a")]
    anchors = {attributes["id"] for _, attributes in page.tags if "id" in attributes}
    for link in links:
        if link.startswith("#"):
            assert link[1:] in anchors
        else:
            assert (written.parent / unquote(link)).exists(), link
    folders = {unquote(link).rstrip("/").rpartition("/")[2] for link in links}
    assert {p.name for p in runs.iterdir()} <= folders
    ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(ids) == len(set(ids))
    pictures = written.with_name("report_figures")
    images = {p.stem for p in pictures.glob("*.png")}
    assert images == {p.stem for p in pictures.glob("*.pdf")} and len(images) >= 5
    for path in pictures.glob("*.png"):
        assert imread(path)[..., :3].min() < 0.9


def test_failures_stand_at_the_head(written: Path) -> None:
    text = Page(written).text
    assert text.index("1 of 5 runs are not done") < text.index("Absolute pose error")
    assert f"diverged: {NASTY}" in text
    assert "4 done, 1 failed" in text
    assert "aligned by yaw_pos (position + yaw)" in text
    assert "p2gd_fgo 0.1.0" in text


def test_names_stay_text(tmp_path: Path) -> None:
    made = [
        replace(
            record(f"g {NASTY}", f"r {NASTY}", seed, "smoother", distribution,
                   metrics(1.0 + seed / 9, 1.0, 1.0), key=f"{seed}{distribution}"),
            study=NASTY, versions={NASTY: NASTY},
        )
        for seed in (0, 1) for distribution in ("grid", NASTY)
    ]  # fmt: skip
    write_records(tmp_path / "results.jsonl", made)
    tex, md = tmp_path / "r.tex", tmp_path / "r.md"
    written = write_report([tmp_path], latex_file=tex, markdown_file=md)
    page = Page(tmp_path / "report.html")
    assert len(page.all("script")) == 1
    assert page.text.count(NASTY) > 10
    assert "<script" not in md.read_text()
    assert r"50 \%" in tex.read_text() and "50 %" not in tex.read_text()
    out = io.StringIO()
    Console(file=out, width=400).print(written.terminal(400))
    assert NASTY in out.getvalue()


def test_the_same_runs_give_the_same_bytes(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run")
    for name in ("a", "b"):
        write_report([run], html=tmp_path / name / "r.html", markdown_file=tmp_path / name / "m")
    for file in ("r.html", "m", "r_figures/accuracy_02_trajectory.pdf"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


def test_a_study_of_two_presets_in_all_forms(tmp_path: Path) -> None:
    write_records(tmp_path / "results.jsonl", records(routes=3, seeds=1, backends=["msckf"]))
    tex, md = tmp_path / "r.tex", tmp_path / "r.md"
    written = write_report([tmp_path], latex_file=tex, markdown_file=md, heading="Two presets")
    page = Page(tmp_path / "report.html")
    assert page.text.count("Two presets") >= 1
    for group in ("kaist_like", "robot_like"):
        assert f"Accuracy: {group}" in page.text
    latex = tex.read_text()
    assert (
        latex.count(r"\label{tab:")
        == len(re.findall(r"\\begin\{table\*?\}", latex))
        == len(re.findall(r"\\end\{table\*?\}", latex))
        == len(written.report.tables) - 1
    )
    labels = re.findall(r"\\label\{(.+?)\}", latex)
    assert len(labels) == len(set(labels))
    assert md.read_text().startswith("# Two presets\n")
    assert "[" in md.read_text().split("what is shown")[1]


def test_a_single_run_without_truth(tmp_path: Path) -> None:
    write_run(tmp_path / "run", truth=False)
    write_report([tmp_path / "run"])
    text = Page(tmp_path / "run" / "report.html").text
    assert "1 of 1 runs have no truth to compare with" in text
    assert "Absolute pose error" not in text and "Tracking quality" in text


def test_different_code_is_said_aloud(tmp_path: Path) -> None:
    made = records(routes=1, seeds=1)
    made[0] = replace(made[0], code="0ther")
    found = find_runs([write_records(tmp_path / "results.jsonl", made)])
    report = build_report(found, title="t", page=tmp_path / "report.html", figures=False)
    assert [alarm.title for alarm in report.alarms] == ["The runs were made with different code"]
    assert not any(section.figures for section in report.sections)


def test_bad_wishes_are_refused(runs: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="alignment"):
        write_report([runs], alignment="se2")
    with pytest.raises(ConfigError, match="distribution=grid"):
        write_report([runs], baseline="distribution=nothing")
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="can't be written"):
        write_report([runs], html=tmp_path / "file" / "report.html")
    assert not (runs / "report.html").exists()
