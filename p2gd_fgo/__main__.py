"""``python -m p2gd_fgo``."""

from p2gd_fgo.cli.main import main

main()
