# SPDX-License-Identifier: Apache-2.0
"""Whether a study has the same bits on aarch64 as here, and where the first differ: under qemu, with Debian's Python.

Run where `./sunpoint shell` runs, on Debian or Ubuntu for x86_64 with qemu-user-static installed. Debian's arm64
packages and the aarch64 wheels of requirements-analysis.lock are unpacked into a folder, nothing is installed.

Compiling the loop of a study takes a minute here and half an hour under qemu. What numba has compiled here is
therefore translated: the optimised LLVM code of every kernel goes through LLVM's aarch64 back end with the options that
numba has there, and takes its place in a cache of its own. A kernel that holds instructions of x86 is left out; numba
compiles it under qemu. `--compile-there` translates nothing.

It flies twice there: with its own libraries, and with the results that the functions of CARRIED (`flight_bits.py`) gave
here.
"""

import argparse
import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np

from css_common import places

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "tools"))

from bootstrap import fingerprint  # noqa: E402  the line above makes it importable
from bootstrap.environment import NONE  # noqa: E402
from bootstrap.layout import lay_out  # noqa: E402
from bootstrap.plan import Need  # noqa: E402
from bootstrap.project import Project, State  # noqa: E402
from bootstrap.work import Work  # noqa: E402

QEMU = "qemu-aarch64-static"
TRIPLE = "aarch64-unknown-linux-gnu"
CPU = {"QEMU_CPU": "cortex-a72", "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
DEBIAN = ("python3.11", "libgomp1", "libstdc++6")


def fetch(folder: Path) -> None:
    """Unpacks Debian's arm64 Python and the wheels into a folder, once."""
    root, state = folder / "root", folder / "apt"
    if not (root / "usr/bin/python3.11").exists():
        (state / "lists/partial").mkdir(parents=True, exist_ok=True)
        (state / "archives/partial").mkdir(parents=True, exist_ok=True)
        (state / "status").touch()
        options = ["APT::Architecture=arm64", "APT::Architectures=arm64", f"Dir::State={state}"]
        options += [f"Dir::State::status={state / 'status'}", f"Dir::Cache={state}"]
        apt = ["apt-get", "-qq", *(word for option in options for word in ("-o", option))]
        subprocess.run([*apt, "update"], check=True)
        subprocess.run([*apt, "install", "-y", "--download-only", "--no-install-recommends", *DEBIAN], check=True)
        for package in sorted((state / "archives").glob("*.deb")):
            subprocess.run(["dpkg-deb", "-x", package, root], check=True)
    site = folder / "site-packages"
    if not (site / "numba").exists():
        uv = ["uv", "pip", "install", "--quiet", "--target", str(site), "--python-platform", "aarch64-manylinux_2_28"]
        lock = [
            "--no-deps",
            "--only-binary",
            ":all:",
            "--require-hashes",
            "-r",
            str(ROOT / "requirements-analysis.lock"),
        ]
        subprocess.run([*uv, "--python-version", "3.11", *lock], check=True)


def packages(folder: Path) -> dict[str, str]:
    """Lays the packages out as on a machine without ROS; where both processors find them, in the same place."""
    shutil.rmtree(folder, ignore_errors=True)
    project = Project(folder, "Linux aarch64")
    project.venv.mkdir(parents=True)
    project.source.symlink_to(ROOT / "src")
    work = Work(project, NONE, {}, State())
    lay_out(work, Need(True, False, fingerprint.packages(project), ()))
    found = work.state.environment.prepend
    return {name: os.pathsep.join(found[name]) for name in ("PYTHONPATH", "AMENT_PREFIX_PATH")}


def translate(here: Path, there: Path) -> tuple[int, int]:
    """Gives a cache of numba's for aarch64 the kernels of one for this machine; how many, and how many are left out."""
    import llvmlite.binding as llvm
    from numba.core.serialize import dumps

    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    machine = llvm.Target.from_triple(TRIPLE).create_target_machine(
        cpu="generic", features="", opt=3, reloc="default", codemodel="jitdefault", jit=True
    )
    done = left = 0
    for index in sorted(here.rglob("*.nbi")):
        folder = there / index.parent.relative_to(here)
        folder.mkdir(parents=True, exist_ok=True)
        with index.open("rb") as file:
            version = pickle.load(file)
            stamp, overloads = pickle.loads(file.read())
        kept = {}
        for (signature, _, code), name in overloads.items():
            (library, kind, (_, bitcode)), *rest = pickle.loads((index.parent / name).read_bytes())
            module = llvm.parse_bitcode(bitcode)
            if "@llvm.x86." in str(module):
                left += 1
                continue
            module.triple, module.data_layout = TRIPLE, str(machine.target_data)
            data = (library, kind, (machine.emit_object(module), module.as_bitcode()))
            (folder / name).write_bytes(dumps((data, *rest)))
            kept[signature, (TRIPLE, "generic", ""), code] = name
            done += 1
        (folder / index.name).write_bytes(pickle.dumps(version, protocol=-1) + dumps((stamp, kept)))
    return done, left


def environment(home: Path, **more: str) -> dict[str, str]:
    """That of this process with a home, and so a cache, of its own, and nothing that slows a processor's BLAS."""
    home.mkdir(parents=True, exist_ok=True)
    if not (home / "config").exists():
        (home / "config").symlink_to(ROOT / "config")
    env = {name: value for name, value in os.environ.items() if not name.startswith(("OPENBLAS", "LD_LIBRARY"))}
    return {**env, "SUNPOINT_HOME": str(home), "PYTHONPYCACHEPREFIX": str(home / "bytecode"), **more}


def differences(here: Path, there: Path) -> list[str]:
    """One line for each stage with a bit that differs, in the order of the stages."""
    left, right = np.load(here), np.load(there)
    lines = [f"{name}: only on one side" for name in sorted(set(left.files) ^ set(right.files))]
    for name in left.files:
        if name in right.files and (line := difference(left[name], right[name])):
            lines.append(f"{name}: {line}")
    return lines


def difference(a: np.ndarray, b: np.ndarray) -> str:
    """How two arrays differ; empty when no bit does. All NaNs are one."""
    if a.shape != b.shape or a.dtype != b.dtype:
        return f"{a.dtype}{a.shape} here, {b.dtype}{b.shape} there"
    other = a != b
    if a.dtype.kind == "f":
        other &= ~(np.isnan(a) & np.isnan(b))
    if not other.any():
        return ""
    first = tuple(int(i) for i in np.argwhere(other)[0])
    text = f"{np.count_nonzero(other)} of {other.size} differ, the first at {first}: {a[first]!r}, {b[first]!r}"
    if a.ndim == 3:  # cases, steps, columns
        step = int(np.argwhere(other.any(axis=(0, 2)))[0, 0])
        text += f"; from step {step} on, in columns {np.flatnonzero(other[:, step].any(axis=0)).tolist()}"
    return text


def main() -> int:
    """Flies here and there; exit code 1 when a bit differs for which no function of CARRIED is the cause."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mission", nargs="?", default="okeefe_2013")
    parser.add_argument("--estimator", default="ekf")
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=60.0, help="simulated time of a flight [s]")
    parser.add_argument("--folder", type=Path, default=places.scratch("aarch64"), help="of what is unpacked and made")
    parser.add_argument("--compile-there", action="store_true", help="let numba compile everything under qemu")
    asked = parser.parse_args()
    folder = asked.folder.absolute()
    fetch(folder)
    study = [ROOT / "benchmarks/flight_bits.py", asked.mission, asked.estimator, str(asked.cases), str(asked.seconds)]
    here, there, carried = folder / "x86_64.npz", folder / "aarch64.npz", folder / "carried.pickle"
    found = packages(folder / "packages")
    env = environment(folder / "x86_64", **found)
    subprocess.run([sys.executable, *study, here, "keep", carried], env=env, check=True)
    if not asked.compile_there:
        caches = (folder / name / ".cache/kernels" for name in ("x86_64", "aarch64"))
        print("{} kernels translated, {} left to numba".format(*translate(*caches)), flush=True)
    found["PYTHONPATH"] += f"{os.pathsep}{folder / 'site-packages'}"
    env = environment(folder / "aarch64", QEMU_LD_PREFIX=str(folder / "root"), **CPU, **found)
    python = [QEMU, folder / "root/usr/bin/python3.11"]
    differ = True
    for title, how in (("each with its own libraries", ()), ("with what CARRIED gave here", ("take", carried))):
        subprocess.run([*python, *study, there, *how], env=env, check=True)
        lines = differences(here, there)
        print(f"{title}:", *lines or ["no bit differs"], sep="\n  ", flush=True)
        differ = any(line.startswith(("2", "3", "4", "5")) for line in lines)
    return 1 if differ else 0


if __name__ == "__main__":
    sys.exit(main())
