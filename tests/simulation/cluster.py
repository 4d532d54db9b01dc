"""A portrait on a cluster of two processes on this machine, one of which is killed half way: the same bits.

A script of its own, as the processes of a cluster import the file that started them.
"""

import os
import signal
import threading

import numpy as np
from distributed import Client, LocalCluster

import pidalab


def main() -> None:
    controller = pidalab.SeriesPIDA(0.3, 0.1, 0.02, ti=1.0, filter_time=0.1, filter_order=3)
    loop = pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), controller)
    grid, t = {"kp": np.linspace(0.1, 0.5, 4000)}, 0.01 * np.arange(2001)
    here = pidalab.portrait(loop, grid, t, load=1.0)
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with LocalCluster(**options) as cluster, Client(cluster) as client, client.get_executor() as executor:
        nanny, *_ = cluster.workers.values()
        killed, pending = nanny.pid, []

        def kill() -> None:
            pending.append(len(client.processing()[nanny.worker_address]))
            os.kill(killed, signal.SIGKILL)

        timer = threading.Timer(0.3, kill)
        timer.start()
        there = pidalab.portrait(loop, grid, t, load=1.0, executor=executor)
        timer.join()
    assert pending[0] > 0, "the worker had nothing left to do when it was killed"
    assert nanny.pid != killed
    assert all(np.array_equal(one, other) for one, other in zip(here, there, strict=True))
    print(f"{pending[0]} parts lost with the worker, none in the end")


if __name__ == "__main__":
    main()
