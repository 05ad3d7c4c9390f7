"""The gallery: sessions that can be opened or made, one entry of a table each."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Annotated, Literal

from pydantic import Field

from studio.foundations.declaring import Terminal, Web, operation
from studio.foundations.errors import NotFoundError, SessionError, StudioError, WorkCancelledError
from studio.foundations.foreign_files import read_file
from studio.foundations.package import assets_folder
from studio.foundations.progress import Progress
from studio.operations.jobs.job_runner import JobKind, SessionJob
from studio.operations.masks import background, give_plates, mask_quality
from studio.operations.person import initialise, subject
from studio.operations.progress import Reporting, reporting, say
from studio.results.drawing_footage.real_data import missing_data, real_data_folder, real_footage
from studio.results.drawing_footage.recipe_file import find_recipe
from studio.results.drawing_footage.recipes import synthesize
from studio.runs.setup.background_setup import BackgroundSource
from studio.sessions.atomic_files import discard, taken
from studio.sessions.importers.folder_layout import plan_folder
from studio.sessions.importers.importing import ImportOptions, Unit, add_footage
from studio.sessions.manifest import FILE_NAME, SessionManifest
from studio.sessions.samples import install_prepared_runs, install_sample, sample_folder
from studio.sessions.session import Session, thumbnail_of
from studio.sessions.workspace import Workspace, begin_session

CardKind = Literal["sample", "recipe", "elsewhere"]


@dataclass(frozen=True, slots=True)
class Card:
    """A session of the gallery.

    name : of the session, and of the sample or recipe unless `recipe` names another.
    kind : "sample" is shipped with the studio; "recipe" is rendered; "elsewhere": its footage cannot be shipped.
    data : where footage or motion that is not shipped comes from.
    footage : where a copy of it lies in the folder of the real data, from which it is imported.
    unit, fps : of that footage, where it does not say; as of an import.
    commands : that make the session from it.
    body, height_mm : its subject; a body that has a file's ending lies in the folder of the real data.
    masks : the source of its masks, "" where they need somebody's hand.
    plates : folder in the footage's with pictures of the empty room, "" where the import takes them.
    exclude_unused : whether regions that no view's hull comes near do not count.
    start_frame : in which its start pose is searched; None where it is not.
    guide : page of the guide on it.
    """

    name: str
    title: str
    words: str
    kind: CardKind = "recipe"
    recipe: str = ""
    data: str = ""
    footage: str = ""
    unit: Unit = ""
    fps: float | None = None
    commands: tuple[str, ...] = ()
    body: str = ""
    height_mm: float | None = None
    masks: BackgroundSource | Literal[""] = ""
    plates: str = ""
    exclude_unused: bool = False
    start_frame: int | None = None
    guide: str = ""

    @property
    def left(self) -> tuple[str, ...]:
        """The commands that the making of the card leaves to the user."""
        done = {"import": True, "subject": self.body or self.height_mm, "background": self.masks,
                "initialise": self.start_frame is not None}  # fmt: skip
        return tuple(line for line in self.commands if not done.get(line.split()[1]))


CYLINDER = (
    "github.com/spoonsso/dannce (MIT), dannce/demo/mouse_cylinder in its history of 2019: videos, plates, calibration,"
    " points labelled by hand."
)
CMU = (
    "Recorded motion of the CMU Graphics Lab Motion Capture Database, in cmu-motion/ of the folder that"
    " STUDIO_REAL_DATA names."
)
CARDS = (
    Card(
        "walk",
        "A walk in a circle",
        "Four cameras, a cluttered room, exact truth: the session of the demo.",
        "sample",
    ),
    Card(
        "planar_arm",
        "A planar arm",
        "Four links, one camera, exact masks: small enough to watch every particle.",
        "sample",
    ),
    Card("branched_arms", "Branched arms", "Two arms from one root: what crossover is for.", "sample"),
    Card(
        "handstand",
        "A handstand",
        "Hands on the floor, a kick-up, a handstand held with a sway. Four cameras.",
    ),
    Card("box", "Stepping over a box", "Straight across the room and over a box that hides the feet."),
    Card("walk-with-turns", "Walking with turns", "Some of them rapid and on the spot; three cameras."),
    Card("eight-cameras", "Eight cameras", "The same room seen from eight sides."),
    Card(
        "twin",
        "Twin of the Lee walk",
        "Cameras and lengths of the Lee walk with a rendered person, so that the truth is exact.",
        recipe="lee-walk-twin",
        data="sequenceB_4 of PARSEC's bodytrack (Apache-2.0), in lee-walk/ of the folder that STUDIO_REAL_DATA names.",
    ),
    Card("dance", "Modern dance", "Leaps and turns of a dancer, seen by four cameras.", data=CMU),
    Card("jumps", "Jumps with turns", "Recorded jumps, seen by four cameras.", data=CMU),
    Card(
        "pair-crossing",
        "Two people, crossing",
        "Each tracked as a body of its own, the masks shared between them; the truth of both.",
    ),
    Card("pair-handshake", "Two people, a handshake", "The same pair, hand in hand for a moment."),
    Card(
        "robot-arm",
        "A robot arm in its cell",
        "Six joints, read from a URDF, among things that look alike. Needs the extra 'robots'.",
    ),
    Card("hand-grasp", "A hand", "A body of 25 parameters whose fingers hide one another."),
    Card(
        "mouse",
        "A mouse in its cage",
        "Four uncalibrated cameras, no picture of the empty cage, 120 frames: a body that no network knows.",
        "elsewhere",
        data="github.com/talmolab/sleap-anipose, tests/data/minimal_session (GPL-3): videos, board pictures, points.",
        footage="mouse/videos",
        commands=(
            "studio calibrate board --board charuco:8x11,24,18.75,DICT_4X4_1000 --intrinsics board --extrinsics board"
            " --floor frame:0 --to take/calibration/cameras.toml",
            "studio import take --into mouse",
            "studio subject mouse --body mouse",
            "studio background mouse --source strokes --strokes strokes.json --no-tune --quality",
            "studio initialise mouse",
        ),
        body="mouse",
        guide="/guide/animal",
    ),
    Card(
        "rearing",
        "A mouse that rears",
        "In a glass cylinder, three cameras, 330 frames: it walks, stands up, and is reflected by the glass.",
        "elsewhere",
        data=CYLINDER,
        footage="mouse-cylinder/three-a",
        commands=(
            "studio import three-a --into rearing",
            "studio subject rearing --body mouse31",
            "studio background rearing --source animal --plates three-a/background",
            "studio initialise rearing --frame 6",
        ),
        body="mouse31",
        masks="animal",
        start_frame=6,
        guide="/guide/animal",
    ),
    Card(
        "cylinder",
        "The same mouse, five cameras",
        "Two seconds of walking. Nobody labelled it: overlays and silhouettes are the judges.",
        "elsewhere",
        data=CYLINDER,
        footage="mouse-cylinder/five",
        commands=(
            "studio import five --into cylinder",
            "studio subject cylinder --body mouse31",
            "studio background cylinder --source animal --plates five/background",
            "studio initialise cylinder",
        ),
        body="mouse31",
        masks="animal",
        start_frame=0,
        guide="/guide/animal",
    ),
    Card(
        "med7",
        "A robot's arm",
        "A stereo pair of 120 mm, five still poses, each found from nothing by its meshes; the encoders are known.",
        "elsewhere",
        data="github.com/lbr-stack/roboreg (Apache-2.0), test/data/lbr_med7 in its history: pictures, masks, meshes.",
        footage="robot-lbr-med7",
        unit="mm",
        fps=1.0,
        commands=(
            "studio import robot-lbr-med7 --unit mm --fps 1 --into med7",
            "studio subject med7 --body robot-lbr-med7/model/lbr_med7.urdf",
            "studio initialise med7",
        ),
        body="robot-lbr-med7/model/lbr_med7.urdf",
        start_frame=0,
        guide="/guide/adding#a-robot",
    ),
    Card(
        "fly",
        "A tethered fly on a ball",
        "Seven grey cameras, 15 frames, no empty picture, no mask: landmarks clicked in a few frames give its lengths,"
        " and its legs' look carries the poses to the other frames.",
        "elsewhere",
        data="github.com/NeLy-EPFL/DeepFly3D (LGPL-3), tests/data/reference: pictures, cameras, a network's points.",
        footage="fly",
        unit="mm",
        fps=100.0,
        commands=(
            "studio import fly --unit mm --fps 100 --into fly",
            "studio subject fly --body fly48",
            "studio body-from-film fly --like fly48 --as my-fly",
            "studio carry-clicks fly --body my-fly --held --first 0 --last 15",
        ),
        body="fly48",
        guide="/guide/animal",
    ),
    Card(
        "wood",
        "A person drawn by others",
        "Clothes that are not ours, a floor of skin's colour, exact truth.",
        "elsewhere",
        data="Drawn by another program than the studio's: drawn-elsewhere/wood.",
        footage="drawn-elsewhere/wood",
        commands=(
            "studio import wood --into wood",
            "studio track wood --start-pose wood/truth/truth.trc",
            "studio evaluate wood run-1 --truth wood/truth/truth.trc",
        ),
        guide="/guide/figures",
    ),
    Card(
        "balance",
        "A man on a beam",
        "Four cameras in a gym, calibrated, with pictures of the empty room: real footage from start to end.",
        "elsewhere",
        data="The demonstration of Pose2Sim (github.com/perfanalytics/pose2sim, Pose2Sim/Demo_SinglePerson, BSD-3).",
        footage="pose2sim-balance",
        commands=(
            "studio import pose2sim-balance --into balance",
            "studio subject balance --height 1800",
            "studio background balance --source combined --plates pose2sim-balance/calibration/extrinsics"
            " --exclude unused",
            "studio initialise balance",
        ),
        height_mm=1800.0,
        masks="combined",
        plates="calibration/extrinsics",
        exclude_unused=True,
        start_frame=0,
        guide="/guide",
    ),
)
"""A card more is an entry more here; a recipe needs its name only."""
GALLERY_PICTURES = assets_folder() / "gallery"
"""A picture of each recipe (`make gallery-pictures`), shown until its session is rendered."""


@dataclass(frozen=True, slots=True)
class CardStanding:
    """A card in a workspace.

    session : the name of the session that was made of it, "" where there is none.
    missing : why it cannot be made here, "" if it can.
    """

    card: Card
    session: str = ""
    missing: str = ""

    @property
    def there(self) -> bool:
        """Whether it was made."""
        return bool(self.session)


class GalleryState(SessionJob):
    """How the making of a card's session stands. notes: what could not be done after the import."""

    notes: list[str] = Field(default_factory=list)


GALLERY = JobKind(
    "gallery",
    "making of a session",
    GalleryState,
    changes_session=True,
    makes_session=True,
    at="/api/gallery/{session}",
    page="/?session={session}",
)


@dataclass(frozen=True, slots=True)
class CardView:
    """A card.

    there : whether its session is in the workspace.
    session : the name of that.
    missing : why it cannot be made here, "" if it can.
    data : where footage or motion that is not shipped comes from.
    commands : that make the session.
    left : those of them that the making of the card leaves to the user.
    guide : page of the guide on it.
    picture : whether it has one.
    job : how its making stands.
    """

    name: str
    title: str
    words: str
    kind: CardKind
    there: bool
    session: str
    missing: str
    data: str
    commands: tuple[str, ...]
    left: tuple[str, ...]
    guide: str
    picture: bool
    job: GalleryState | None


@dataclass(frozen=True, slots=True, eq=False)
class Gallery:
    """The gallery.

    cards : all of them, with what each lacks.
    made : the session of the requested card.
    notes : what could not be done after its import.
    """

    cards: tuple[CardStanding, ...]
    made: Session | None = None
    notes: tuple[str, ...] = ()


@operation
def gallery(
    make: Annotated[
        str, Field(description="The card whose session is opened or made."), Terminal(metavar="CARD")
    ] = "",
    *,
    into: Annotated[
        str | Path | None,
        Field(description="Name or path of the session; default: the card's."),
        Terminal(metavar="SESSION", kind=str),
        Web(left_out=True),
    ] = None,
    frames: Annotated[int | None, Field(ge=1, description="Render only so many frames.")] = None,
    progress: Reporting = None,
) -> Gallery:
    """List the sessions of the gallery, and make one: bundled samples are copied, rendered clips rendered with their
    exact truth.

    A session that exists is kept. For footage that cannot be shipped it says where it comes from and which commands
    make the session; where the folder that STUDIO_REAL_DATA names has a copy, it is imported, and of the other commands
    those are done that need nobody's hand: the body, the masks, the start pose.

    Raises NotFoundError for an unknown card, SessionError for one whose footage is not available.
    """
    workspace = Workspace()
    made, notes = None, ()
    if make:
        card = card_of(make)
        with reporting(progress, make) as report:
            known = standing_of(card, workspace).session or make
            place = workspace.place_for(into) if into else workspace.root / known
            made, notes = make_card(card, place, frames, report)
        say(progress, notes)
    return Gallery(standings(workspace), made, notes)


def card_of(name: str) -> Card:
    """A card by its name. Raises NotFoundError."""
    cards = {card.name: card for card in CARDS}
    if name not in cards:
        raise NotFoundError(f"The gallery has no card '{name[:64]}'.", f"It has {', '.join(cards)}.")
    return cards[name]


def standings(workspace: Workspace) -> tuple[CardStanding, ...]:
    """All cards in a workspace, in the order in which they are shown."""
    manifests = workspace.manifests()
    return tuple(_standing(card, workspace, manifests) for card in CARDS)


def standing_of(card: Card, workspace: Workspace) -> CardStanding:
    return _standing(card, workspace, workspace.manifests())


def _standing(card: Card, workspace: Workspace, manifests: Mapping[str, SessionManifest]) -> CardStanding:
    name = _made_of(card, manifests)
    if card.kind == "recipe" and (missing := missing_data(find_recipe(card.recipe or card.name))):
        return CardStanding(card, name, missing)
    if card.kind == "elsewhere" and real_footage(card.footage) is None:
        missing = f"There is no '{card.footage}' in the folder that STUDIO_REAL_DATA names."
        return CardStanding(card, name, missing)
    if not name and (workspace.root / card.name).exists():
        missing = f"Its name, '{card.name}', is taken in this workspace: rename the session that has it."
        return CardStanding(card, name, missing)
    return CardStanding(card, name)


def _made_of(card: Card, manifests: Mapping[str, SessionManifest]) -> str:
    """The name of the session that was made of a card, the card's own before others; "" where there is none."""
    own = [name for name in (card.name,) if name in manifests]
    others = [name for name in manifests if name != card.name] if card.kind == "elsewhere" else []
    return next((name for name in (*own, *others) if _is_of(card, name, manifests[name])), "")


def _is_of(card: Card, name: str, manifest: SessionManifest) -> bool:
    """Whether a session came from a card: by what it says of its origin, else by its name and its footage's files."""
    if card.kind != "elsewhere":
        return manifest.imported_from in ("", f"recipe {card.recipe or card.name}.toml")
    origin, wanted = PurePath(manifest.imported_from).parts, PurePath(card.footage).parts
    if origin[-len(wanted) :] == wanted:
        return True
    if name != card.name:
        return False
    return origin[-1:] == wanted[-1:] or _has_footage_of(card, manifest)


def _has_footage_of(card: Card, manifest: SessionManifest) -> bool:
    """Whether a session's footage has the names of a card's, as far as there is a copy of that."""
    source = real_footage(card.footage)
    try:
        footage = () if source is None else plan_folder(source, None, bare=True).footage
    except StudioError:
        return False
    names = {PurePath(camera.path).name for camera in manifest.footage.cameras}
    return bool(names) and names == {path.name for path in footage}


def card_view(standing: CardStanding, job: GalleryState | None) -> CardView:
    """A card for a page. job : how its making stands."""
    card = standing.card
    return CardView(
        name=card.name,
        title=card.title,
        words=card.words,
        kind=card.kind,
        there=standing.there,
        session=standing.session,
        missing=standing.missing,
        data=card.data,
        commands=card.commands,
        left=card.left,
        guide=card.guide,
        picture=standing.there or card.kind == "sample" or _shipped_picture(card).is_file(),
        job=job,
    )


def card_picture(card: Card, workspace: Workspace) -> bytes:
    """A small picture (JPEG) of a card's session, or the shipped one.

    Raises NotFoundError where it has none.
    """
    path = _shipped_picture(card)
    if name := standing_of(card, workspace).session:
        path = workspace.session(name).thumbnail()
    elif card.kind == "sample" and (content := thumbnail_of(Session(sample_folder(card.name)))) is not None:
        return content
    if path is None or not path.is_file():
        raise NotFoundError(f"Card '{card.name}' has no picture.", "Make its session first.")
    return read_file(path)


def _shipped_picture(card: Card) -> Path:
    return GALLERY_PICTURES / f"{card.name}.jpg"


def make_card(
    card: Card, place: Path, frames: int | None, progress: Progress
) -> tuple[Session, tuple[str, ...]]:
    """The session of a card at a place, and what could not be done after its import; an existing one is opened.

    Raises StudioError, also for a place that another session has; then nothing was made.
    """
    if (place / FILE_NAME).is_file():
        session = Session(place)
        if not _is_of(card, place.name, session.manifest):
            raise taken(place)
        return session, ()
    if card.kind == "elsewhere":
        return _imported(card, place, progress)
    if card.kind == "sample":
        return install_sample(Workspace(place.parent), card.name, place.name), ()
    return Session(synthesize(card.recipe or card.name, place, progress, frames)), ()


def _imported(card: Card, place: Path, progress: Progress) -> tuple[Session, tuple[str, ...]]:
    """The session of footage that is not shipped, with the calibration beside it, if any, set up as far as that needs
    nobody's hand; and what could not be done. Nothing is left of one that is cancelled.
    """
    source = real_footage(card.footage)
    if source is None:
        raise SessionError(
            f"The footage of '{card.name}' cannot be shipped.",
            f"It comes from {card.data} Put it at '{card.footage}' into the folder that STUDIO_REAL_DATA names.",
        )
    is_file = bool(PurePath(card.body).suffix)
    session = begin_session(place, card.title, str(real_data_folder() / card.body) if is_file else card.body)
    try:
        options = ImportOptions(unit=card.unit, fps=card.fps)
        add_footage(session, source, options, progress=progress)
        notes = _set_up(card, place, source, progress)
    except BaseException:
        discard(place)
        raise
    return Session(place), notes


def _set_up(card: Card, place: Path, source: Path, progress: Progress) -> tuple[str, ...]:
    """Do what follows a card's import up to the first step that fails, and say why that failed. Raises
    WorkCancelledError.
    """
    for verb, do in _steps(card, source):
        try:
            do(Session(place), progress)
        except WorkCancelledError:
            raise
        except StudioError as problem:
            return (
                f"The footage is imported; its {verb} could not be set up. {problem.message} {problem.hint}",
            )
    return ()


def _steps(card: Card, source: Path) -> Iterator[tuple[str, Callable[[Session, Progress], object]]]:
    """What follows a card's import: a name, and what does it to the session. source : the folder of its footage."""

    def take_subject(session: Session, progress: Progress) -> object:
        return subject(session, card.height_mm, body=session.manifest.body, progress=progress)

    def make_masks(session: Session, progress: Progress) -> object:
        if card.plates:
            plates = sorted(path for path in (source / card.plates).iterdir() if path.is_file())
            session = give_plates(session, {}, plates)
        background(session, card.masks or "masks", exclude_unused=card.exclude_unused, progress=progress)
        made = Session(session.path)
        return mask_quality(made, progress=progress) if made.is_comparable else None

    def find_start(session: Session, progress: Progress) -> object:
        return initialise(session, card.start_frame or 0, progress=progress)

    if card.body or card.height_mm:
        yield "subject", take_subject
    if card.masks:
        yield "background", make_masks
    if card.start_frame is not None:
        yield "start pose", find_start


def prepare_demo(workspace_root: Path) -> Session:
    """The bundled walk as a session of the workspace with its shipped runs, copied there if absent, and beside it the
    planar arm, with which the course begins.
    """
    workspace = Workspace(workspace_root)
    for sample in ("planar_arm", "walk"):
        install_prepared_runs(session := install_sample(workspace, sample), sample)
    return session
