"""A worker process as its owner sees it: asked for a run, listened to, killed when it is late."""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import p2gd_fgo
from p2gd_fgo.errors import ConfigError
from p2gd_fgo.study.keys import code_hash
from p2gd_fgo.study.runs import Recorded, Rendered, Run
from p2gd_fgo.study.work import Keep
from p2gd_fgo.study.worker import receive, send
from p2gd_fgo.threads import thread_environment

Message = tuple[Any, ...]
"""``("ready", code)``, ``("progress", done, total)``, ``("rendered", sentence or None)``,
``("record", record)``, or ``("gone", reason)`` as the last one."""


class WorkerProcess:
    """One process with one thread for every numeric library.

    Parameters
    ----------
    inbox
        Gets ``(self, message)`` for every message of the process.
    """

    def __init__(self, inbox: queue.Queue[tuple[WorkerProcess, Message]]) -> None:
        package = str(Path(p2gd_fgo.__file__).resolve().parents[1])
        paths = [package, *filter(None, [os.environ.get("PYTHONPATH")])]
        self._log = tempfile.TemporaryFile()  # noqa: SIM115  (closed with the process)
        self._process = subprocess.Popen(
            [sys.executable, "-m", "p2gd_fgo.study.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            env=os.environ | thread_environment(1) | {"PYTHONPATH": os.pathsep.join(paths)},
            start_new_session=True,  # Ctrl-C is the owner's affair
        )
        self._inbox = inbox
        threading.Thread(target=self._listen, daemon=True).start()

    @property
    def pid(self) -> int:
        """Of the process."""
        return self._process.pid

    def render(self, sources: Sequence[Rendered | Recorded]) -> None:
        """Ask for recordings; ``rendered`` answers."""
        self._ask(("render", list(sources)))

    def run(self, run: Run, folder: Path, keep: Keep) -> None:
        """Ask for a run; ``record`` answers."""
        self._ask(("run", run, str(folder), keep))

    def kill(self) -> None:
        """End it at once; ``gone`` follows."""
        self._process.kill()

    def close(self) -> None:
        """End it, wait until it has, and let go of its files."""
        self._process.kill()
        self._process.wait()
        self._log.close()
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):
            self._process.stdin.close()

    def _ask(self, message: Message) -> None:
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):  # it has died, and "gone" is on its way
            send(self._process.stdin, message)

    def _listen(self) -> None:
        assert self._process.stdout is not None
        try:
            while True:
                self._inbox.put((self, receive(self._process.stdout)))
        except EOFError:
            self._inbox.put((self, ("gone", self._epitaph())))

    def _epitaph(self) -> str:
        code, lines = self._process.wait(), []
        if code < 0:
            return f"the process was ended by {signal.Signals(-code).name}"
        with suppress(ValueError):  # closed by its owner, who doesn't ask
            self._log.seek(0)
            lines = self._log.read().decode("utf-8", "replace").strip().splitlines()
        last = f": {lines[-1]}" if lines else ""
        return f"the process ended with exit code {code}{last}"


def check_code(code: str) -> None:
    """Refuse a worker whose code isn't this process's.

    Raises
    ------
    ConfigError
        The code was changed while the study ran, or the worker is another installation's.
    """
    if code != code_hash():
        raise ConfigError(
            f"a worker runs other code ({code}) than this study ({code_hash()}): the sources were "
            "changed, or other versions are installed there; start the study again"
        )
