"""`studio reproduce`."""

import shlex
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from studio.cli.output import errors_in_words, note, print_result, progress
from studio.garden.reproduction.catalogue import EXPERIMENTS, find_experiments
from studio.garden.reproduction.experiment import Experiment
from studio.garden.reproduction.findings_files import number_in_words, read_findings, work_folder, work_place
from studio.garden.reproduction.guide_findings import guide_folder, write_into_guide
from studio.garden.reproduction.plan import FULL_SEEDS, QUICK_SEEDS, scale_of
from studio.garden.reproduction.runner import Reproduction, reproduce
from studio.operations.jobs.cluster import CLUSTER_HELP
from studio.results.comparison.findings import FAILED
from studio.results.comparison.findings_document import REPORT, REPRODUCTIONS, SUMMARY, Document

NOT_CONCLUDED = 1
NOT_RUN = "not run yet"

OUT_HELP = (
    f"Folder, or address of a store, of everything that is kept; default: '{REPRODUCTIONS}' in the workspace."
)
SEEDS_HELP = f"Seeds of every setting; default {FULL_SEEDS}, with --quick {QUICK_SEEDS}."
QUICK_HELP = "A look in minutes: fewer seeds, frames and settings."
PROCESSES_HELP = "How many at once; default: one a core."
INTO_GUIDE_HELP = (
    "Write the findings into the guide of this checkout, thinned, with the commits that measured it "
    "(web_assets/guide/reproduction)."
)
JSON_HELP = "Print one JSON object and nothing else on standard output."


@click.command("reproduce")
@click.argument("name")
@click.option("--out", metavar="FOLDER", help=OUT_HELP)
@click.option("--quick", is_flag=True, help=QUICK_HELP)
@click.option("--seeds", type=click.IntRange(1, 1000), metavar="N", help=SEEDS_HELP)
@click.option("--processes", type=click.IntRange(1, 1024), metavar="N", help=PROCESSES_HELP)
@click.option("--cluster", default="", metavar="ADDRESS", help=CLUSTER_HELP)
@click.option("--into-guide", is_flag=True, help=INTO_GUIDE_HELP)
@click.option("--json", "as_json", is_flag=True, help=JSON_HELP)
def reproduce_command(name: str, as_json: bool, **given: Any) -> None:  # noqa: ANN401 - as Click reads them
    """Rerun the experiment NAME of a paper, `all` of them, or `list` what there is.

    Outcomes are kept as they come: the same command goes on where an interrupted one stopped. Writes a report
    (report.html), numbers (JSON, CSV) and charts (CSV) with the verdict on each of the paper's claims. Exit code 1
    says that an experiment could not be concluded; a claim that is not reproduced is a result like any other.
    """
    wanted = _Wanted(**given)
    with errors_in_words():
        place = work_place(wanted.out)
        if name == "list":
            print_result(_listed(work_folder(place)), as_json)
            return
        result = _run(find_experiments(name), place, wanted)
        concluded = [document for document in result.documents if document["verdict"] != FAILED]
        for document in concluded if wanted.into_guide else ():
            note(f"The guide: {write_into_guide(guide_folder(), document)}")
        print_result(_answer(result, place), as_json)
        if len(concluded) < len(result.documents):
            sys.exit(NOT_CONCLUDED)


@dataclass(frozen=True, slots=True)
class _Wanted:
    """What the options say."""

    out: str | None
    quick: bool
    seeds: int | None
    processes: int | None
    cluster: str
    into_guide: bool


def _run(experiments: tuple[Experiment, ...], place: str, wanted: _Wanted) -> Reproduction:
    try:
        with progress("reproducing") as report:
            return reproduce(
                experiments,
                place,
                scale_of(wanted.seeds, wanted.quick),
                report,
                catalogue=tuple(EXPERIMENTS.values()),
                processes=wanted.processes,
                cluster=wanted.cluster,
            )
    except KeyboardInterrupt:
        typed = shlex.join(["studio", *sys.argv[1:]])
        note(f"Every finished trial is kept in '{place}'. Go on with: {typed}")
        raise


def _listed(folder: Path) -> Document:
    lines: list[Document] = []
    for experiment in EXPERIMENTS.values():
        document = read_findings(folder, experiment.name)
        lines.append(
            {
                "name": experiment.name,
                "title": experiment.title,
                "source": experiment.source,
                "claim": experiment.claim,
                "verdict": document["verdict"] if document else None,
                "firm": document["firm"] if document else None,
            }
        )
    text = "\n\n".join(
        f"{line['name']}  ({_verdict(line) if line['verdict'] else NOT_RUN})\n"
        f"  {line['source']}: {line['title']}\n  {line['claim']}"
        for line in lines
    )
    return {"experiments": lines, "text": text}


def _answer(result: Reproduction, place: str) -> Document:
    lines: list[str] = []
    for document in result.documents:
        lines.append(f"{document['name']}: {_verdict(document)}")
        lines += [f"  {number_in_words(number)}" for number in document["numbers"]]
        lines += [f"  {words}" for words in (document["words"], *document["notes"]) if words]
    lines.append(f"{result.measured} trials run, {result.kept} kept from before, {result.failed} failed.")
    lines.append(f"Report: {place}/{REPORT}")
    return {
        "out": place,
        "report": f"{place}/{REPORT}",
        "summary": f"{place}/{SUMMARY}",
        "trials": {"measured": result.measured, "kept": result.kept, "failed": result.failed},
        "experiments": list(result.documents),
        "text": "\n".join(lines),
    }


def _verdict(document: Document) -> str:
    firm = document["firm"] or document["verdict"] == FAILED
    return document["verdict"] if firm else f"{document['verdict']}, not firm"
