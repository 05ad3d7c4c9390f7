"""`studio reproduce`."""

import shlex
import sys
from pathlib import Path

import click

from studio.cli.output import errors_in_words, note, print_result, progress
from studio.garden.reproduction.catalogue import EXPERIMENTS, find_experiments
from studio.garden.reproduction.experiment import Experiment
from studio.garden.reproduction.findings_files import FOOTAGE, number_in_words, read_findings
from studio.garden.reproduction.guide_findings import guide_folder, write_into_guide
from studio.garden.reproduction.plan import FULL_SEEDS, QUICK_SEEDS, scale_of
from studio.garden.reproduction.runner import Reproduction, reproduce
from studio.operations.jobs.cluster import CLUSTER_HELP
from studio.results.comparison.findings import FAILED
from studio.results.comparison.findings_document import REPORT, REPRODUCTIONS, SUMMARY, Document
from studio.results.comparison.trials import Scale
from studio.sessions.object_stores import folder_of, is_address
from studio.sessions.remote_sessions import bring_work
from studio.sessions.workspace import workspace_root

NOT_CONCLUDED = 1
NOT_RUN = "not run yet"

OUT_HELP = (
    f"Folder, or address of a store, of everything that is kept; default: '{REPRODUCTIONS}' in the workspace."
)
SEEDS_HELP = f"Seeds of every setting; default {FULL_SEEDS}, with --quick {QUICK_SEEDS}."
QUICK_HELP = "A look in minutes: fewer seeds, frames and settings."
PROCESSES_HELP = "How many at once; default: one a core."
INTO_GUIDE_HELP = (
    "Write what was found into the guide of this checkout, thinned, with the commits that measured it "
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
def reproduce_command(
    name: str,
    out: str | None,
    quick: bool,
    seeds: int | None,
    processes: int | None,
    cluster: str,
    into_guide: bool,
    as_json: bool,
) -> None:
    """Rerun the experiment NAME of a paper, `all` of them, or `list` what there is.

    Outcomes are kept as they come: the same command goes on where an interrupted one stopped. Writes a report
    (report.html), numbers (JSON, CSV) and charts (CSV) with the verdict on each of the paper's claims. Exit code 1
    says that an experiment could not be concluded; a claim that is not reproduced is a result like any other.
    """
    with errors_in_words():
        place = folder_of(out) if out else str(workspace_root() / REPRODUCTIONS)
        if not is_address(place):
            place = str(Path(place).expanduser().absolute())
        if name == "list":
            folder = bring_work(place, FOOTAGE) if is_address(place) else Path(place)
            print_result(_listed(folder), as_json)
            return
        found = _run(find_experiments(name), place, scale_of(seeds, quick), processes, cluster)
        concluded = [document for document in found.documents if document["verdict"] != FAILED]
        for document in concluded if into_guide else ():
            note(f"The guide: {write_into_guide(guide_folder(), document)}")
        print_result(_answer(found, place), as_json)
        if any(document["verdict"] == FAILED for document in found.documents):
            sys.exit(NOT_CONCLUDED)


def _run(
    experiments: tuple[Experiment, ...], place: str, scale: Scale, processes: int | None, cluster: str
) -> Reproduction:
    try:
        with progress("reproducing") as report:
            catalogue = tuple(EXPERIMENTS.values())
            return reproduce(
                experiments, place, scale, report, catalogue=catalogue, processes=processes, cluster=cluster
            )
    except KeyboardInterrupt:
        typed = shlex.join(["studio", *sys.argv[1:]])
        note(f"Every finished trial is kept in '{place}'. Go on with: {typed}")
        raise


def _listed(folder: Path) -> Document:
    lines: list[Document] = []
    for experiment in EXPERIMENTS.values():
        found = read_findings(folder, experiment.name)
        lines.append(
            {
                "name": experiment.name,
                "title": experiment.title,
                "source": experiment.source,
                "claim": experiment.claim,
                "verdict": found["verdict"] if found else None,
                "firm": found["firm"] if found else None,
            }
        )
    text = "\n\n".join(
        f"{line['name']}  ({_verdict(line) if line['verdict'] else NOT_RUN})\n"
        f"  {line['source']}: {line['title']}\n  {line['claim']}"
        for line in lines
    )
    return {"experiments": lines, "text": text}


def _answer(found: Reproduction, place: str) -> Document:
    lines: list[str] = []
    for document in found.documents:
        lines.append(f"{document['name']}: {_verdict(document)}")
        lines += [f"  {number_in_words(number)}" for number in document["numbers"]]
        lines += [f"  {words}" for words in (document["words"], *document["notes"]) if words]
    lines.append(f"{found.measured} trials run, {found.kept} kept from before, {found.failed} failed.")
    lines.append(f"Report: {place}/{REPORT}")
    return {
        "out": place,
        "report": f"{place}/{REPORT}",
        "summary": f"{place}/{SUMMARY}",
        "trials": {"measured": found.measured, "kept": found.kept, "failed": found.failed},
        "experiments": list(found.documents),
        "text": "\n".join(lines),
    }


def _verdict(document: Document) -> str:
    firm = document["firm"] or document["verdict"] == FAILED
    return document["verdict"] if firm else f"{document['verdict']}, not firm"
