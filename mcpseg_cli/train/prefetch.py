"""Drawing ahead: a thread makes the next few items while the caller works on one."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from queue import Full, Queue
from threading import Event, Thread
from typing import TypeVar

T = TypeVar("T")
_LOOK_S = 0.1  # from one look at whether the caller has gone to the next


@contextmanager
def ahead(items: Iterable[T], count: int) -> Iterator[Iterator[T]]:
    """Draw items in a thread of its own; order stays.

    Args:
        items: Drawn from in that thread only.
        count: How many may be waiting.

    Yields:
        An iterator over the items; it raises what drawing them raised. Leaving the context ends the
        thread.
    """
    queue: Queue[tuple[T] | BaseException | None] = Queue(count)
    is_over = Event()

    # the thread waits for room, but not after the caller has gone
    def put(entry: tuple[T] | BaseException | None) -> None:
        while not is_over.is_set():
            try:
                queue.put(entry, timeout=_LOOK_S)
            except Full:
                continue
            return

    def draw() -> None:
        try:
            for item in items:
                put((item,))
                if is_over.is_set():
                    return
            put(None)
        except BaseException as error:  # handed to the caller, who raises it
            put(error)

    # leaving the context ends it, however that happens
    thread = Thread(target=draw, name="draw-ahead", daemon=True)
    thread.start()
    try:
        yield _taken(queue)
    finally:
        is_over.set()
        thread.join()


def _taken(queue: Queue[tuple[T] | BaseException | None]) -> Iterator[T]:
    """Yield what a queue is given until it is given None."""
    while (entry := queue.get()) is not None:
        if isinstance(entry, BaseException):
            raise entry
        yield entry[0]
