"""Who draws batches while the network learns: a thread, or several processes for a fast device."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.context import BaseContext

from torch.utils.data import DataLoader, Dataset, Sampler

from mcpseg_cli.errors import McpsegError, TrainingError
from mcpseg_cli.train.objective import Tensors
from mcpseg_cli.train.packing import Packed
from mcpseg_cli.train.prefetch import ahead
from mcpseg_cli.train.sources import AnyBatch, Batches

_AHEAD = 4  # batches that may be waiting
_EACH_AHEAD = 2  # batches that each process draws ahead
_Key = tuple[int, int, int]  # source, epoch, position


class Drawing:
    """Draws batches ahead; which ones, and in which order, does not depend on who draws.

    Args:
        sources: All that is drawn from.
        to_tensors: What makes tensors of a batch.
        workers: Processes; 0 for a thread.
        on_device: Batches go to a device with memory of its own, in one piece each.
    """

    def __init__(
        self,
        sources: Sequence[Batches],
        to_tensors: Callable[[AnyBatch], Tensors],
        *,
        workers: int,
        on_device: bool,
    ) -> None:
        self._sources, self._workers, self._on_device = sources, workers, on_device
        self._drawn = _Drawn(sources, to_tensors, is_packed=on_device or workers > 0)
        self._keys = _Keys()
        self._loader: DataLoader[Tensors | Packed | McpsegError] | None = None

    @contextmanager
    def batches(
        self, source: Batches, epoch: int, positions: Iterable[int]
    ) -> Iterator[Iterator[Tensors | Packed]]:
        """Draw batches of one of the sources, in order.

        Yields:
            An iterator over them; it raises what drawing them raised.
        """
        number = next(i for i, each in enumerate(self._sources) if each is source)
        keys = [(number, epoch, position) for position in positions]
        if self._workers == 0:
            with ahead(map(self._drawn.__getitem__, keys), _AHEAD) as drawn:
                yield map(_raised, drawn)
            return
        self._keys.keys = keys
        yield self._drawn_by_processes()

    def _drawn_by_processes(self) -> Iterator[Tensors | Packed]:
        """Yield what the processes draw; they are started once and live on."""
        if self._loader is None:
            self._loader = DataLoader(
                self._drawn,
                batch_size=None,
                sampler=self._keys,
                num_workers=self._workers,
                prefetch_factor=_EACH_AHEAD,
                persistent_workers=True,
                pin_memory=self._on_device,
                multiprocessing_context=_context(),
                worker_init_fn=_leave_interrupts,
            )
        try:
            yield from map(_raised, self._loader)
        except (RuntimeError, OSError, EOFError) as error:
            if isinstance(error, RuntimeError) and "DataLoader worker" not in str(error):
                raise
            raise TrainingError(
                "a process that draws batches is gone; expected it to live; lower --jobs if memory "
                "was short, and go on with --resume"
            ) from error

    def close(self) -> None:
        """End the processes."""
        self._loader = None


class _Drawn(Dataset["Tensors | Packed | McpsegError"]):
    """Batches by source, epoch and position."""

    def __init__(
        self,
        sources: Sequence[Batches],
        to_tensors: Callable[[AnyBatch], Tensors],
        *,
        is_packed: bool,
    ) -> None:
        self._sources, self._to_tensors, self._is_packed = sources, to_tensors, is_packed

    def __getitem__(self, key: _Key) -> Tensors | Packed | McpsegError:
        """Draw one; what is wrong with the data is given back, as it may have to travel."""
        number, epoch, position = key
        try:
            tensors = self._to_tensors(self._sources[number].batch(epoch, position))
        except (McpsegError, OSError) as error:
            return McpsegError(str(error))
        return tensors.packed() if self._is_packed else tensors


class _Keys(Sampler[_Key]):
    """What is to be drawn next."""

    def __init__(self) -> None:
        self.keys: list[_Key] = []

    def __iter__(self) -> Iterator[_Key]:
        return iter(self.keys)

    def __len__(self) -> int:
        return len(self.keys)


def _context() -> BaseContext | None:
    """Start processes from a server that has imported what they need, where there can be one."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return None
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([__name__, "mcpseg_cli.train.windows"])
    return context


def _leave_interrupts(_: int) -> None:
    """Leave Ctrl-C to the process that trains: it stops after the step at hand."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _raised(drawn: Tensors | Packed | McpsegError) -> Tensors | Packed:
    """Raise what went wrong."""
    if isinstance(drawn, McpsegError):
        raise drawn
    return drawn
