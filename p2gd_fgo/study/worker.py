"""The process that does runs: ``python -m p2gd_fgo.study.worker``, started by ``process``.

Messages are pickles with their length before them: in by standard input, out by what standard
output was at the start. Whatever the libraries print goes to standard error. The process ends when
its input does, so that nothing goes on after the study was killed.
"""

from __future__ import annotations

import os
import pickle
import queue
import signal
import struct
import sys
import threading
from pathlib import Path
from typing import IO, Any

from p2gd_fgo.threads import set_thread_environment

_LENGTH = struct.Struct("<Q")


def send(stream: IO[bytes], message: object) -> None:
    """Write one message."""
    data = pickle.dumps(message)
    stream.write(_LENGTH.pack(len(data)) + data)
    stream.flush()


def receive(stream: IO[bytes]) -> Any:
    """Read one message.

    Raises
    ------
    EOFError
        The other side has gone.
    """
    head = stream.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        raise EOFError
    (size,) = _LENGTH.unpack(head)
    data = stream.read(size)
    if len(data) < size:
        raise EOFError
    return pickle.loads(data)


def main() -> None:
    """Do what is asked until the input ends."""
    set_thread_environment(1)
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    asked: queue.Queue[Any] = queue.Queue()
    threading.Thread(target=_listen, args=(sys.stdin.buffer, asked), daemon=True).start()
    from p2gd_fgo.errors import P2gdError
    from p2gd_fgo.study.data import provide
    from p2gd_fgo.study.keys import code_hash
    from p2gd_fgo.study.work import execute

    def progress(done: int, total: int) -> None:
        send(out, ("progress", done, total))

    send(out, ("ready", code_hash()))
    while True:
        kind, *rest = asked.get()
        if kind == "run":
            run, folder, keep = rest
            send(out, ("record", execute(run, Path(folder), keep, progress)))
            continue
        try:
            for source in rest[0]:
                provide(source, progress)
            send(out, ("rendered", None))
        except P2gdError as error:
            send(out, ("rendered", str(error)))


def _listen(stream: IO[bytes], asked: queue.Queue[Any]) -> None:
    try:
        while True:
            asked.put(receive(stream))
    except EOFError:
        os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    main()
