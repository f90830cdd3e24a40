"""Write docs/configuration.md from the configuration's models: ``make docs``."""

from __future__ import annotations

from pathlib import Path

from p2gd_fgo.config import dump_yaml, load_config

_HEAD = """# Configuration

Every field with its default and meaning. `null` in `frontend` is filled by the image width: over
1000 px 180 features, grid [10, 6], 40 px apart (the paper's KAIST settings), else 150, [8, 6],
30 px (its robot's). A file holds what differs; `extends: other.yaml` (or a list) builds on other
files, relative to the file itself, later ones winning. On the command line any field is
`--set frontend.max_features=180`. Written by `make docs`.

```yaml
"""


def main() -> None:
    """Write the page."""
    text = _HEAD + dump_yaml(load_config(), comments=True) + "```\n"
    Path(__file__).with_name("configuration.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
