"""A study as a folder that somebody else can read and compute again: an RO-Crate.

The folder is a store with one study, and ``ro-crate-metadata.json`` says what is in it: each run is
an action with its instrument, objects and results. Nothing else is needed to compute it again.

References
----------
RO-Crate 1.1, https://w3id.org/ro/crate/1.1; Workflow Run Crate 0.5, Leo et al. (2024),
https://doi.org/10.1371/journal.pone.0309210.
"""

from __future__ import annotations

import datetime
import json
import re
import shutil
import uuid
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple, Self
from urllib.parse import quote

from solver.files import opened
from solver.version import __version__
from studies.definition.identity import canonical, solver_hash
from studies.definition.study import Study
from studies.definition.vocabulary import MISSING, SOLVED
from studies.errors import StudyError
from studies.execution.run import StudyOutcome
from studies.scenes.file_scene import FileScene
from studies.storage import runfile, seal
from studies.storage.origin import PROGRAM, files_of, meshes_of
from studies.storage.provenance import NONE
from studies.storage.store import Store
from studies.views.columns import placed
from studies.views.differing import diff, difference_table
from studies.views.picking import study_of
from studies.views.reading import find_study, one_error, open_netcdf

METADATA = "ro-crate-metadata.json"
"""File of a crate that describes the others."""
_CONTEXT = [
    "https://w3id.org/ro/crate/1.1/context",
    "https://w3id.org/ro/terms/workflow-run/context",
]
_PROFILES = {
    "https://w3id.org/ro/wfrun/process/0.5": ("Process Run Crate", "0.5"),
    "https://w3id.org/ro/wfrun/workflow/0.5": ("Workflow Run Crate", "0.5"),
    "https://w3id.org/workflowhub/workflow-ro-crate/1.0": ("Workflow RO-Crate", "1.0"),
}
_BIOSCHEMAS = "https://bioschemas.org/profiles/{}/1.0-RELEASE"
_COMPLETED, _FAILED = (
    f"http://schema.org/{status}ActionStatus" for status in ("Completed", "Failed")
)
_PROGRAM, _LANGUAGE, _README = "#residua", "#study-file", "README.md"
_SPDX = (
    r"CC0-1\.0|CC-BY(-NC)?(-SA|-ND)?-[1-4]\.\d|ODbL-1\.0|ODC-By-1\.0|PDDL-1\.0|MIT|"
    r"BSD-[23]-Clause|Apache-2\.0|MPL-2\.0|EUPL-1\.[12]|[AL]?GPL-\d\.\d-(only|or-later)"
)
"""Licences that are called by their names in the list of SPDX; others are texts."""
_KINDS = {
    ".nc": "application/x-netcdf",
    ".json": "application/json",
    ".toml": "application/toml",
    ".md": "text/markdown",
    ".csv": "text/csv",
}
"""Endings of files and their media types."""
Entity = dict[str, Any]


def export(path: Path, target: Path) -> None:
    """Write a study of a store, with all of its runs, as a crate.

    Parameters
    ----------
    path : what `find_study` finds
    target : folder that is made; it may be there already, empty

    Raises
    ------
    StudyError
        if the folder is not empty, or another version of the solver computed the study, or a run is
        missing
    """
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise StudyError("--crate", str(target), "must be a folder that is new or empty")
    study, store = study_of(find_study(path))
    target = target.resolve()  # a name, also of `.`
    part = target.with_name(f"{target.name}.{uuid.uuid4().hex}.part")
    try:
        part.mkdir(parents=True)
        _Writer(study, store, part).write()
        part.replace(target)
    except OSError as error:
        raise StudyError("--crate", str(target), f"cannot be written: {error.strerror}") from None
    finally:
        shutil.rmtree(part, ignore_errors=True)


class Compared(NamedTuple):
    """What differs from the runs of a crate, as text, and whether they count as the same."""

    text: str
    same: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Crate:
    """A crate that is there.

    Attributes
    ----------
    study : its study as this version reads it
    dataset : path of its data set
    runs : ids of its runs
    other : which version computed it, if it was another one; else empty
    """

    study: Study
    dataset: Path
    runs: frozenset[str]
    other: str

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read a crate.

        Raises
        ------
        StudyError
            if the folder does not hold one study, or this version does not allow it
        """
        dataset, other = find_study(folder), ""
        name = f"study {dataset.parent.name}"
        with open_netcdf(dataset) as found:
            attrs = found.attrs
        with one_error(dataset):
            content = seal.content_of(dataset.with_name("study.json"), name)
        commit = f", commit {attrs['commit']}" if "commit" in attrs else ""
        made = f"the crate was computed by {attrs['source']}{commit}, sources "
        made += str(attrs["solver_source"])
        try:
            study = Study.from_dict(content, scenes=Store(folder).scene)
        except StudyError as error:
            allowed = f"{error.allowed} ({made}; this is Residua {__version__})"
            first = StudyError(error.field, error.value, allowed)
            raise StudyError.of([first, *error.others], error.count) from None
        if study.id != dataset.parent.name:
            differs = "the scene, or what reads the study, which differs here"
            if attrs["solver_source"] != solver_hash():
                differs = f"it, as this is Residua {__version__}, sources {solver_hash()}"
            other = f"{made}. The same ids need {differs}. The runs are computed, and compared"
        runs = frozenset(path.stem for path in folder.glob("runs/*.nc"))
        return cls(study=study, dataset=dataset, runs=runs, other=other)

    def compared(self, store: Store, outcome: StudyOutcome) -> Compared:
        """Return what differs between the crate and its study as it was computed again."""
        ids = frozenset(store.runs_of(self.study))
        told = f"{len(ids & self.runs)} of {len(self.runs)} runs have the same id"
        if before := len(ids - {*outcome.computed}):
            told = f"{before} of {len(ids)} runs were not computed now: --out had them\n{told}"
        same = ids == self.runs or bool(self.other)
        with open_netcdf(self.dataset) as first, open_netcdf(outcome.dataset) as second:
            if all((each["status"] == MISSING).all() for each in (first, second)):
                return Compared(f"{told}; neither study has found a value", same)
            found = diff(first, second)
        same = same and not (any(found.only) or found.statuses)
        return Compared(f"{told}; {difference_table(found)}", same)


@dataclass
class _Writer:
    """Writes a crate to a folder."""

    study: Study
    store: Store
    folder: Path
    entities: list[Entity] = field(default_factory=list)
    files: list[str] = field(default_factory=list)
    varied: list[str] = field(default_factory=list)
    used: set[str] = field(default_factory=set)

    def write(self) -> None:
        """Write all files, and last what describes them."""
        study, store = self.study, self.store
        wanted = store.asked(study) if study.kind.chooses else set(study.run_ids())
        if wanted is None:
            raise StudyError("path", study.name, "has not ended: compute the rest of it first")
        there = store.sound(wanted)
        if missing := len(wanted - there.keys()):
            raise StudyError("path", study.name, f"lacks {missing} runs: compute them first")
        dataset = store.dataset(study.id)
        with open_netcdf(dataset) as found:
            attrs = dict(found.attrs)
            if not study.kind.chooses and (found["status"] == MISSING).any():
                allowed = "has runs that its data set lacks: run the study again"
                raise StudyError("path", study.name, allowed)
        of_study = f"studies/{study.id}"
        self._copy(dataset, f"{of_study}/{dataset.name}", f"data set of {study.name}")
        definition = store.study_path(study.id, "study.json")
        self._copy(definition, f"{of_study}/{definition.name}", f"entries of {study.name}")
        self._text(_README, _readme(study, attrs), about=_to("./"))
        (self.folder / "runs").mkdir()
        texts = [self._text(name, text) for name, text in files_of(study).items()]
        given = [*texts, f"{of_study}/{definition.name}", *self._scene()]
        runs = self._runs(sorted(there), texts[0], given[1:])
        whole = self._whole(texts[0], given[1:], f"{of_study}/{dataset.name}", runs)
        self._workflow(texts[0], attrs)
        self._root(texts[0], attrs, [whole, *(each["@id"] for each in runs)])
        graph = [{name: _unpacked(value) for name, value in e.items()} for e in self.entities]
        described = {"@context": _CONTEXT, "@graph": graph}
        text = json.dumps(described, indent=1, ensure_ascii=False)
        (self.folder / METADATA).write_text(text, encoding="utf-8")

    def _copy(self, source: Path, name: str, words: str, **more: Any) -> None:
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with opened(source) as file, path.open("xb") as copy:
            shutil.copyfileobj(file, copy)
        self._file(name, words, **more)

    def _text(self, name: str, text: str, **more: Any) -> str:
        """Write a text, and return its name in the crate."""
        while (self.folder / name).exists() or name == METADATA:
            name = f"study-{name}"
        (self.folder / name).write_bytes(text.encode())
        self._file(name, f"{name} as it was written", **more)
        return name

    def _file(self, name: str, words: str, **more: Any) -> None:
        path = self.folder / name
        self.files.append(name)
        self._add(
            quote(name), "File", name=words, contentSize=str(path.stat().st_size),
            sha256=seal.digest(path),
            encodingFormat=_KINDS.get(path.suffix, "application/octet-stream"), **more,
        )  # fmt: skip

    def _add(self, own: str, kind: str, **entries: Any) -> None:
        """Describe what has an id."""
        self.entities.append(_entity(own, kind, **entries))

    def _scene(self) -> list[str]:
        """Copy the scene from a file, and its meshes; return their names in the crate."""
        scene = self.study.problem
        if not (isinstance(scene, FileScene) and scene.posted):
            return []
        names = self.store.blobs.names(f"scenes/{scene.id}/*")
        meshes = {name for name, _ in meshes_of(self.study)}
        for name in names:
            own = PurePosixPath(name).name
            words = f"{'mesh or table' if own in meshes else 'data'} of the scene {scene.name}"
            self._copy(self.store.blobs.path(name), name, f"{own}: {words}")
        return names

    def _runs(self, ids: list[str], study: str, given: list[str]) -> list[Entity]:
        """Copy the runs; describe the parameters that vary, and an action for each run."""
        known: dict[str, dict[str, Any]] = {}
        said: dict[str, tuple[str, str]] = {}
        for run_id in ids:
            with runfile.opened(self.store.run_path(run_id)) as run:
                known[run_id] = runfile.global_attributes(run)
                status, message = (run[n].asstr()[...].item() for n in ("status", "message"))
            said[run_id] = status, message
        values = self._values({k: json.loads(each["parameters"]) for k, each in known.items()})
        actions = []
        for run_id, attrs in known.items():
            name = f"runs/{run_id}.nc"
            words = f"run {run_id}: {said[run_id][0]}"
            self._copy(self.store.run_path(run_id), name, words, exampleOfWork=_to("#run"))
            action = _action(run_id, attrs, *said[run_id])
            parameters = json.loads(attrs["parameters"])
            at = placed({name: parameters[name] for name in self.varied})
            action["description"] = at or "the run of the study"
            action["instrument"] = _to(quote(study))
            action["object"] = [_to(quote(each)) for each in given]
            action["object"] += [_to(each) for each in values[run_id]]
            action["result"] = _to(name)
            if machine := attrs.get("run_machine"):
                action["resourceUsage"] = [_to(self._used("machine", machine))]
                memory = self._used("peak-memory", attrs["run_peak_memory"])
                action["resourceUsage"].append(_to(memory))
            actions.append(action)
        self.entities += actions
        results = [_to(each["result"]["@id"]) for each in actions]
        self.entities.append(_formal("#run", "run", "File", results, "file of a run"))
        return actions

    def _values(self, runs: Mapping[str, Mapping[str, Any]]) -> dict[str, list[str]]:
        """Describe each value of the parameters that vary; return those of each run."""
        found: dict[str, list[str]] = {run_id: [] for run_id in runs}
        for name in dict.fromkeys(name for each in runs.values() for name in each):
            texts = {run_id: canonical(each.get(name)) for run_id, each in runs.items()}
            distinct = list(dict.fromkeys(texts.values()))
            if len(distinct) < 2:
                continue
            ids = {text: f"#{name}-{k + 1}" for k, text in enumerate(distinct)}
            self.varied.append(name)
            for run_id, text in texts.items():
                found[run_id].append(ids[text])
            examples = [_to(each) for each in ids.values()]
            kind = "Text" if any(text[:1] in '"[{' for text in distinct) else "Number"
            self.entities.append(_formal(f"#{name}", name, kind, examples, "parameter that varies"))
            for text, own in ids.items():
                value = json.loads(text)
                plain = value if isinstance(value, int | float | str) else text
                of = _to(f"#{name}")
                self._add(own, "PropertyValue", name=name, value=plain, exampleOfWork=of)
        return found

    def _used(self, what: str, value: str) -> str:
        """Describe what a run has used, once for all runs of the same value; return its id."""
        own = f"#{what}-{seal.digest_of(value.encode())[:12]}"
        if own not in self.used:
            self.used.add(own)
            self._add(own, "PropertyValue", name=what, propertyID=what, value=value)
        return own

    def _whole(self, study: str, given: list[str], dataset: str, runs: list[Entity]) -> str:
        """Describe the computation of the study, of which the runs are parts."""
        began = [each["startTime"] for each in runs if "startTime" in each]
        ended = [each["endTime"] for each in runs]
        own = f"#study-{self.study.id}"
        self._add(
            own, "CreateAction", name=f"computation of the study {self.study.name}",
            description=f"{len(runs)} runs, and their data set", instrument=_to(quote(study)),
            object=[_to(quote(each)) for each in given], result=[_to(dataset)],
            actionStatus=_COMPLETED, **({"startTime": min(began)} if began else {}),
            **({"endTime": max(ended)} if ended else {}),
        )  # fmt: skip
        return own

    def _workflow(self, name: str, attrs: Mapping[str, Any]) -> None:
        """Describe the study file as a workflow, its language and the program."""
        (main,) = (each for each in self.entities if each["@id"] == quote(name))
        main["@type"] = ["File", "SoftwareSourceCode", "ComputationalWorkflow"]
        main |= {
            "name": f"study {self.study.name}",
            "conformsTo": _to(_BIOSCHEMAS.format("ComputationalWorkflow")),
            "version": self.study.id,
            "programmingLanguage": _to(_LANGUAGE),
            "input": [_to(f"#{each}") for each in self.varied],
            "output": [_to("#run")],
        }
        url = _to("https://toml.io/en/v1.0.0")
        self._add(_LANGUAGE, "ComputerLanguage", name="study file of Residua (TOML)", url=url)
        self._add(
            _PROGRAM, "SoftwareApplication", name="Residua",
            softwareVersion=str(attrs["source"]).removeprefix("Residua "),
            description=f"sources {attrs['solver_source']}; libraries {attrs['versions']}",
            softwareRequirements=f"SHA-256 of requirements.lock: {attrs['lock']}",
            **({"identifier": attrs["commit"]} if "commit" in attrs else {}),
        )  # fmt: skip

    def _root(self, main: str, attrs: Mapping[str, Any], actions: list[str]) -> None:
        """Describe the crate itself."""
        study = self.study
        licence, described = _license(study.licence)
        root = _entity(
            "./", "Dataset", name=study.name,
            description=study.note or f"{len(actions) - 1} runs of {study.problem.summary}",
            datePublished=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
            license=licence, citation=attrs["cite"] if attrs["cite"] != NONE else PROGRAM,
            conformsTo=[_to(each) for each in _PROFILES],
            hasPart=[_to(quote(each)) for each in self.files], mainEntity=_to(quote(main)),
            mentions=[_to(each) for each in [*actions, _PROGRAM]],
            **({"identifier": f"https://doi.org/{study.doi}"} if study.doi else {}),
        )  # fmt: skip
        conforms = [_to("https://w3id.org/ro/crate/1.1"), _to([*_PROFILES][-1])]
        descriptor = _entity(METADATA, "CreativeWork", about=_to("./"), conformsTo=conforms)
        profiles = [
            _entity(own, "CreativeWork", name=name, version=version)
            for own, (name, version) in _PROFILES.items()
        ]
        self.entities[:0] = [descriptor, root, *profiles, *described]


def _license(given: str) -> tuple[Entity | str, list[Entity]]:
    """Return the licence of a crate: what stands for it, and its description if it has one."""
    if not given:
        return "none is given: ask the authors of the study", []
    if not re.fullmatch(rf"https?://\S+|{_SPDX}", given):
        return given, []
    own = given if given.startswith("http") else f"https://spdx.org/licenses/{given}"
    return _to(own), [_entity(own, "CreativeWork", name=given)]


def _action(run_id: str, attrs: Mapping[str, Any], status: str, message: str) -> Entity:
    """Return the action that computed a run: it failed if the run has no results."""
    failed = status not in SOLVED
    error = {"error": f"{status}: {message}".removesuffix(": ")} if failed else {}
    ended = attrs.get("run_ended", attrs["created"])
    began = {"startTime": _time(attrs["run_started"])} if "run_started" in attrs else {}
    return _entity(
        f"#run-{run_id}", "CreateAction", name=f"computation of the run {run_id}", **began,
        endTime=_time(ended), actionStatus=_FAILED if failed else _COMPLETED, **error,
    )  # fmt: skip


def _time(given: str) -> str:
    """Return a time as the profiles have it: with an offset, not Z."""
    return given.replace("Z", "+00:00")


def _formal(own: str, name: str, kind: str, examples: list[Entity], words: str) -> Entity:
    profile = _to(_BIOSCHEMAS.format("FormalParameter"))
    return _entity(
        own, "FormalParameter", conformsTo=profile, name=name, additionalType=kind,
        description=words, workExample=examples,
    )  # fmt: skip


def _unpacked(value: Any) -> Any:
    """Return the only entry of a list instead of the list, as RO-Crate recommends."""
    return value[0] if isinstance(value, list) and len(value) == 1 else value


def _entity(own: str, kind: str, **entries: Any) -> Entity:
    return {"@id": own, "@type": kind, **entries}


def _to(own: str) -> Entity:
    return {"@id": own}


def _readme(study: Study, attrs: Mapping[str, Any]) -> str:
    commit = f" (commit {attrs['commit']})" if "commit" in attrs else ""
    return f"""# {study.name}

Runs of the scene {study.problem.name}, computed with {attrs["source"]}{commit}.

    residua run FOLDER --out NEW

with the path of this folder, and that of a new one, computes all runs again, and compares them
with these. With the same version of Residua they have the same ids; another one names the version
that is needed.
`residua show FOLDER` lists the runs. `{METADATA}` describes each file and each run.
"""
