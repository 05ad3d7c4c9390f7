"""Blocks of sixteen poses shared among Numba's threads.

Every kernel exists twice: `chunk`, which does the blocks first..last - 1 in the calling thread, and `all`,
which hands equal chunks to threads. What comes out for a pose never depends on which. Threads are woken only
for half a millisecond's work each or more: on a machine whose cores are all busy (a browser drawing the scene,
say) waiting for a second thread to be scheduled can take longer than all of a layer's weights.
"""

from collections.abc import Callable

from studio.numba_in_threads import ONE_LAUNCH, numba


def run_blocks(
    chunk: Callable[..., None], everything: Callable[..., None], blocks: int, least: int, *arguments: object
) -> None:
    """Run a kernel over all blocks, on as many threads as `numba.get_num_threads()` says and get enough of them.

    least : blocks that are worth a thread.
    """
    threads = min(int(numba.get_num_threads()), blocks // least)
    if threads <= 1:
        chunk(0, blocks, *arguments)
        return
    with ONE_LAUNCH:
        everything(threads, *arguments)
