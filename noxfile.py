"""Everything that a change must pass, as sessions with names. `.ci/run`, the workflows and people run these.

    nox                               # lint, types, docs, quick: before every commit
    nox -s quick-3.13 -- tests/check  # one Python; what follows -- goes to the tool of the session
    nox --no-venv -s slow             # with the Python and the libraries that nox runs with; nothing is installed
    GCSPLAN_LEAST=1 nox -s quick      # with the least versions that pyproject.toml allows

Each session has an environment of its own, unless nox is called with ``--no-venv``.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tarfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import nox

TOP = Path(__file__).parent
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
CAMPAIGNS = (
    "limits",
    "bounds",
    "links",
    "parameters",
    "crash",
    "files",
    "zones",
    "published",
    "heights",
    "hours",
    "stale",
    "worlds",
    "winds",
)
CAMPAIGN_S = 30
CAMPAIGNS_AT_ONCE = 3
SAMPLES = ("jacksboro", "jacksboro-wing")
"""Samples whose missions have the same bytes on every Python."""

nox.needs_version = ">=2024.4.15"
nox.options.sessions = ["lint", "types", "docs", "quick"]


def ready(session: nox.Session, *extras: str) -> str:
    """Install gcsplan in place with these extras. Returns the Python that has it; without an environment, nox's own."""
    if not session.virtualenv.is_sandboxed:
        return sys.executable
    python = str(Path(session.bin, "python"))
    packages = ["-e", f".[{','.join(extras)}]"]
    if os.environ.get("GCSPLAN_LEAST"):
        session.install("uv")
        module(session, python, "uv", "pip", "install", "--quiet", "--resolution", "lowest-direct", *packages)
    else:
        session.install(*packages)
    return python


def module(session: nox.Session, python: str, *arguments: str) -> None:
    """Run a module with its arguments."""
    session.run(python, "-m", *arguments, external=True)


@nox.session
def lint(session: nox.Session) -> None:
    """Rules, format, spelling, language."""
    python = ready(session, "dev")
    module(session, python, "ruff", "check", ".")
    module(session, python, "ruff", "format", "--check", ".")
    module(session, python, "codespell_lib")
    module(session, python, "tests.test_language")


@nox.session
def types(session: nox.Session) -> None:
    """Types of the package, and of what the tests share."""
    module(session, ready(session, "dev"), "mypy", *session.posargs)


@nox.session
def docs(session: nox.Session) -> None:
    """The documents, built without the network where the system can shut it off; into site/ or the folder given."""
    python = ready(session, "docs")
    folder = Path(session.posargs[0] if session.posargs else "site").absolute()
    apart = ["unshare", "--map-root-user", "--net"]
    if not shutil.which("unshare") or subprocess.run([*apart, "true"], capture_output=True, check=False).returncode:
        apart = []
    command = [*apart, python, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    session.run(*command, env={"NO_MKDOCS_2_WARNING": "1"}, external=True)


@nox.session(python=PYTHONS)
def quick(session: nox.Session) -> None:
    """The quick suite."""
    module(session, ready(session, "test"), "pytest", *session.posargs)


@nox.session
def slow(session: nox.Session) -> None:
    """Tests that take seconds each: brute force, browsers, hostile files."""
    python = ready(session, "test", "cluster", "parquet")
    module(session, python, "pytest", "-m", "slow and not nightly", *session.posargs)


@nox.session
def nightly(session: nox.Session) -> None:
    """Tests that do at length what a campaign does in each change, or that a change seldom breaks."""
    module(session, ready(session, "test", "cluster", "parquet"), "pytest", "-m", "nightly", *session.posargs)


@nox.session
def coverage(session: nox.Session) -> None:
    """Statements and branches that the quick suite reaches. Kernels are left out: they run compiled."""
    python = ready(session, "dev", "cluster", "parquet")
    module(session, python, "pytest", "--cov", "--cov-report=term:skip-covered", *session.posargs)


def attack(session: nox.Session, python: str, names: list[str], *arguments: str) -> None:
    """Run campaigns, a few at once; print the output of each when it ends."""

    def outcome(name: str) -> tuple[bool, str]:
        command = [python, "-m", f"tests.campaigns.{name}", *arguments]
        ended = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
        return ended.returncode != 0, f"\n-- {name}\n{ended.stdout}"

    failed = []
    with ThreadPoolExecutor(CAMPAIGNS_AT_ONCE) as pool:
        for name, (fault, words) in zip(names, pool.map(outcome, names), strict=True):
            print(words, end="", flush=True)
            failed += [name] if fault else []
    if failed:
        session.error(f"campaigns that found faults: {', '.join(failed)}")


@nox.session
def campaigns(session: nox.Session) -> None:
    """The attacks of docs/safety.md, half a minute each; or the named ones, with the options that follow the names."""
    given = list(session.posargs)
    first = next((k for k, word in enumerate(given) if word.startswith("-")), len(given))
    names, options = given[:first] or list(CAMPAIGNS), given[first:] or ["--seconds", str(CAMPAIGN_S)]
    attack(session, ready(session, "test", "cluster", "parquet"), names, *options)


@nox.session
def sizes(session: nox.Session) -> None:
    """Large files and large worlds, up to the limits that docs/safety.md states and beyond them."""
    options = session.posargs or ["--seconds", str(CAMPAIGN_S)]
    attack(session, ready(session, "test", "cluster", "parquet"), ["files", "worlds"], "--sizes", *options)


def programs_of(environment: Path) -> Path:
    """The folder of an environment's programs."""
    return environment / ("Scripts" if sys.platform == "win32" else "bin")


def readme_line(name: str) -> str:
    """The one line of the code block behind ``<!-- ci:NAME -->`` in README.md."""
    text = (TOP / "README.md").read_text(encoding="utf-8")
    found = re.findall(rf"^<!-- ci:{name} -->\n```sh\n(.+)\n```$", text, re.MULTILINE)
    if len(found) != 1:
        raise ValueError(f"README.md must hold exactly one line after <!-- ci:{name} -->, not {len(found)}")
    return str(found[0])


@nox.session(python=["3.11", "3.13"])
def package(session: nox.Session) -> None:
    """The wheel plans in a fresh environment; in the unpacked sdist both lines of README do what they promise."""
    if session.virtualenv.is_sandboxed:
        session.install("build")
        python = str(Path(session.bin, "python"))
    else:
        python = sys.executable
    work = Path(session.create_tmp()).absolute()
    shutil.rmtree(work)
    work.mkdir()
    module(session, python, "build", "--outdir", str(work / "dist"))
    wheel, sdist = *(work / "dist").glob("*.whl"), *(work / "dist").glob("*.tar.gz")
    module(session, python, "venv", str(work / "wheel"))
    programs = programs_of(work / "wheel")
    session.run(str(programs / "python"), "-m", "pip", "install", "-q", str(wheel), external=True)
    with session.chdir(work):
        session.run(str(programs / "gcsplan"), "plan", "sample:jacksboro", "--upload", "sim", external=True)
    with tarfile.open(sdist) as archive:
        archive.extractall(work, filter="data")
    # README's lines begin with python3: let that be the Python of this session.
    (work / "bin").mkdir()
    (work / "bin" / "python3").symlink_to(shutil.which(python) or python)
    path = os.pathsep.join([str(work / "bin"), os.environ.get("PATH", "")])
    with session.chdir(work / sdist.name.removesuffix(".tar.gz")):
        for line in (readme_line("run"), " ".join([readme_line("test"), *session.posargs])):
            session.run("bash", "-euo", "pipefail", "-c", line, env={"PATH": path, "PYTHONPATH": None}, external=True)
    shutil.rmtree(work)


def found_pythons() -> dict[str, str]:
    """Every supported Python of this machine, on the path or in pyenv: its version and its program."""
    root = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    found = {}
    for version in PYTHONS:
        programs = [shutil.which(f"python{version}"), *map(str, sorted(root.glob(f"versions/{version}.*/bin/python")))]
        for program in filter(None, programs):
            command = [program, "-c", "import sys; print('%d.%d' % sys.version_info[:2])"]
            if subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip() == version:
                found[version] = program
                break
    return found


def missions_of(session: nox.Session, programs: Path, folder: Path) -> dict[str, bytes]:
    """Plan the samples by counted work alone; every file that goes to a vehicle, by its name."""
    written = {}
    for sample in SAMPLES:
        command = [str(programs / "gcsplan"), "plan", f"sample:{sample}", "-o", str(folder / sample)]
        session.run(*command, env={"GCSPLAN_CLOCK": "off", "PYTHONPATH": None}, external=True, silent=True)
        for kind in ("*.waypoints", "*.plan"):
            written |= {f"{sample}/{file.name}": file.read_bytes() for file in (folder / sample).glob(kind)}
    return written


@nox.session(venv_backend="none")
def pythons(session: nox.Session) -> None:
    """With the same libraries, every Python of this machine writes the same missions, byte for byte."""
    work = Path(session.create_tmp()).absolute()
    here = str(session.run(sys.executable, "-m", "pip", "list", "--format=freeze", silent=True, external=True))
    lines = [line for line in here.splitlines() if re.match(r"(?!gcsplan|pip|setuptools)[\w.-]+==", line)]
    (work / "same.txt").write_text("\n".join(lines), encoding="utf-8")
    found, missions = found_pythons(), {}
    for version in PYTHONS:
        if version not in found:
            session.warn(f"python{version} is not on this machine: skipped")
            continue
        programs = programs_of(work / version)
        module(session, sys.executable, "uv", "venv", "-q", "--clear", "--python", found[version], str(work / version))
        target = ["--python", str(programs / "python"), "--constraints", str(work / "same.txt"), str(TOP)]
        module(session, sys.executable, "uv", "pip", "install", "-q", *target)
        missions[version] = missions_of(session, programs, work / f"missions-{version}")
    shutil.rmtree(work)
    first, *others = missions
    if not missions[first]:
        session.error(f"python{first} wrote no missions")
    if differ := [version for version in others if missions[version] != missions[first]]:
        session.error(f"missions differ from those of python{first} on {', '.join(differ)}")
    session.log(f"{len(missions[first])} files have the same bytes on {', '.join(missions)}")
