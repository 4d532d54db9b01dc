"""Kernels for the book's notebooks, forked off a process that has done once what each would do again.

Starting IPython, importing matplotlib, drawing a first figure and reading the machine code of the engine takes a kernel
a few seconds, and the book has more than twenty. A forked kernel has all that in memory; its namespace is as empty as
that of any other. ``python kernels.py 3`` is that process: it listens on the socket that is its descriptor 3, reads a
request, forks, and answers with the number of the new process. It ends with the process that started it, whose children
use it too.
"""

import atexit
import gc
import importlib
import json
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
from importlib.metadata import EntryPoint
from io import BytesIO
from pathlib import Path
from typing import Any

from jupyter_client.provisioning import KernelProvisionerFactory, LocalProvisioner

PRELOADED = (
    "control",
    "IPython.core.completer",
    "ipykernel.kernelapp",
    "ipykernel.ipkernel",
    "matplotlib.pyplot",
    "mpmath",
    "myst_nb",
    "pandas.io.formats.html",
    "pidalab.identification",
    "paperledger",
    "pidalab.optimal",
    "pidalab.plots",
    "pidalab.rules",
    "pidalab.simulation.portrait",
    "scipy.integrate",
    "scipy.optimize",
    "scipy.signal",
    "tqdm",
)
ADDRESS = "PIDALAB_KERNELS"  # variable of the environment that names the server's socket


class Forked:
    """A process that the server has forked: what a provisioner asks of `subprocess.Popen`."""

    stdin = stdout = stderr = None

    def __init__(self, pid: int) -> None:
        self.pid = pid

    def poll(self) -> int | None:
        """Return None while the process runs."""
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            return 0
        return None

    def wait(self) -> int:
        """Return at once: whoever waits has polled until the process was gone."""
        return 0

    def send_signal(self, signum: int) -> None:
        """Send a signal to a process that may be gone."""
        if self.poll() is None:
            os.kill(self.pid, signum)

    def kill(self) -> None:
        """End the process."""
        self.send_signal(signal.SIGKILL)

    def terminate(self) -> None:
        """Ask the process to end."""
        self.send_signal(signal.SIGTERM)


class ForkingProvisioner(LocalProvisioner):
    """Starts a kernel by a fork of this process's server."""

    async def launch_kernel(self, cmd: list[str], **kwargs: Any) -> Any:
        """Return how to connect to the new kernel."""
        request = {
            "arguments": cmd[cmd.index("ipykernel_launcher") + 1 :],
            "folder": str(kwargs.get("cwd") or Path.cwd()),
            "environment": kwargs["env"],
            "quiet": kwargs.get("stderr") is not None,
        }
        try:
            with socket.socket(socket.AF_UNIX) as line:
                line.connect(os.environ[ADDRESS])
                line.sendall(json.dumps(request).encode() + b"\n")
                self.process = Forked(int(line.makefile().readline()))
        except (ConnectionError, ValueError) as error:  # no connection, or no answer
            raise RuntimeError("the process that forks kernels has ended") from error
        self.pid, self.pgid = self.process.pid, None
        return self.connection_info


def start_server() -> None:
    """Start the server of this process and of its children, which ends with this process."""
    folder = tempfile.TemporaryDirectory()
    os.environ[ADDRESS] = str(Path(folder.name) / "kernels")
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(os.environ[ADDRESS])
        listener.listen()
        descriptor = listener.fileno()
        command = [sys.executable, __file__, str(descriptor)]
        server = subprocess.Popen(command, stdin=subprocess.PIPE, pass_fds=[descriptor])

    def stop() -> None:
        server.communicate()  # its input ends
        folder.cleanup()

    atexit.register(stop)


def fork_kernels() -> None:
    """Let all kernels that this process starts be forked, where the system can do so.

    macOS can fork, but not safely once its matrix library, Accelerate, has been used, as NumPy uses it there.
    """
    os.environ.setdefault(
        "PIDALAB_COMPILE", "1"
    )  # kernels that are not forked wait for the machine code, too
    if not hasattr(os, "fork") or sys.platform == "darwin":
        return
    # one thread for each notebook: their matrices are small
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if ADDRESS not in os.environ:
        start_server()
    factory = KernelProvisionerFactory.instance()
    name = "forking-provisioner"
    place = f"{__name__}:{ForkingProvisioner.__name__}"
    factory.provisioners[name] = EntryPoint(name, place, factory.GROUP_NAME)
    factory.default_provisioner_name = name


def become_kernel(request: dict[str, Any]) -> None:
    """Run as a kernel in a process of its own, and end with it."""
    from ipykernel.kernelapp import IPKernelApp

    nothing = os.open(os.devnull, os.O_RDWR)
    for descriptor in (0, 1, 2) if request["quiet"] else (0, 1):  # the server's own pipes are not a kernel's
        os.dup2(nothing, descriptor)
    os.setsid()
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["environment"])
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    # it ends with the server; ipykernel reads the environment for that when it is imported, in the server
    parent = f"--IPKernelApp.parent_handle={os.getppid()}"
    try:
        IPKernelApp.launch_instance(argv=[*request["arguments"], parent])
    finally:
        os._exit(0)


def warm_up() -> None:
    """Import what the notebooks import, draw a figure, and compile the engine or read its machine code."""
    os.environ["MPLBACKEND"] = "module://matplotlib_inline.backend_inline"
    from pidalab.warm_up import respond, sample

    other = os.fork()  # it compiles one half of the engine, this process the other
    if not other:
        try:
            respond()
        finally:
            os._exit(0)
    for name in PRELOADED:
        importlib.import_module(name)
    import pandas as pd
    from matplotlib.figure import Figure
    from tqdm import tqdm

    tqdm.monitor_interval = 0  # no thread that watches its bars: this process forks
    pd.set_option("display.max_columns", 20)  # its default in a kernel; it takes this process for a terminal
    Figure().subplots(subplot_kw={"xlabel": "$t$"}).figure.savefig(BytesIO(), format="svg")
    sample()
    os.waitpid(other, 0)
    respond()


def serve(listener: socket.socket) -> None:
    """Answer requests until whoever started this process has ended."""
    warm_up()
    # no kernel looks for garbage among what is here, and seldom among its own: figures make much and keep little
    gc.freeze()
    gc.set_threshold(100_000, 20, 100)
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # a kernel that ends leaves nothing behind
    while sys.stdin not in select.select([listener, sys.stdin], [], [])[0]:
        with listener.accept()[0] as line:
            request = json.loads(line.makefile().readline())
            pid = os.fork()
            if pid:
                line.sendall(f"{pid}\n".encode())
        if not pid:
            listener.close()
            become_kernel(request)


if __name__ == "__main__":
    serve(socket.socket(fileno=int(sys.argv[1])))
