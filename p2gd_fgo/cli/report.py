"""``p2gd-fgo report``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from p2gd_fgo.config.loading import load_config
from p2gd_fgo.threads import set_thread_environment


def report(
    places: Annotated[
        list[Path],
        typer.Argument(
            metavar="DIR...", show_default=False,
            help="Run directories, folders of them at any depth, or a study's output.",
        ),
    ],
    html: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", show_default=False,
            help="The page [default: report.html in the first DIR].",
        ),
    ] = None,
    markdown: Annotated[
        Path | None,
        typer.Option(metavar="FILE", show_default=False, help="Write the tables as Markdown."),
    ] = None,
    latex: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", show_default=False, help="Write the tables as LaTeX (booktabs)."
        ),
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", show_default=False,
            help="Folder for every figure as PNG and PDF [default: beside the page].",
        ),
    ] = None,
    baseline: Annotated[
        str | None,
        typer.Option(
            metavar="AXIS=NAME", show_default=False,
            help="What the methods are compared with [default: distribution=grid].",
        ),
    ] = None,
    alignment: Annotated[
        str | None,
        typer.Option(
            show_default=False,
            help="Of the absolute errors: yaw_pos, se3, sim3 or origin [default: the runs'].",
        ),
    ] = None,
    title: Annotated[
        str | None, typer.Option(show_default=False, help="Heading of the page.")
    ] = None,
) -> None:  # fmt: skip
    """Tables and figures of any runs: here, as a page, as Markdown and as LaTeX."""
    set_thread_environment(load_config().runtime.threads)
    from p2gd_fgo.report.compare_table import FULL_WIDTH
    from p2gd_fgo.report.pages.write import write_report

    written = write_report(
        places, html=html, markdown_file=markdown, latex_file=latex, figures=figures,
        baseline=baseline, alignment=alignment, heading=title,
    )  # fmt: skip
    console = Console()
    if not console.is_terminal:
        console.width = max(console.width, FULL_WIDTH)
    console.print(written.terminal(console.width))
    for path in written.files:
        console.print(f"written: {path}", soft_wrap=True, highlight=False, markup=False)
