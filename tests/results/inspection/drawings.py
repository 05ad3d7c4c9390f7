"""What the views draw, without a studio: the pages' own modules in a blank page of the browser, given tables."""

import json
from dataclasses import replace
from typing import Any
from urllib.parse import urlsplit

from playwright.sync_api import Browser, Route

from studio.foundations.package import assets_folder
from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.tables import Selection, Viewed
from studio.results.inspection.views import look

ADDRESS = "http://drawings.test/"
BLANK = (
    '<!doctype html><html data-theme="light"><link rel="stylesheet" href="/tokens.css"><body></body></html>'
)
TYPES = {".js": "text/javascript", ".css": "text/css", ".html": "text/html"}
DRAW = """async ([view, of, stored, tried, selection, written]) => {
  const modules = ['js/view_sheet.js', 'js/views_search.js', 'js/views_answer.js', 'js/why_drawing.js',
    'js/layer_axis.js', 'js/chart_looks.js', 'vendor/echarts.esm.min.js'];
  const [{ Sheet, records }, { SEARCH_VIEWS }, { ANSWER_VIEWS }, { drawLimbs }, axes, looks, echarts] =
    await Promise.all(modules.map((name) => import('/' + name)));
  const { countedIn, onOneAxis } = axes;
  const put = (answer) => answer && ({ counted: countedIn(answer, 1),
    tables: Object.fromEntries(answer.tables.map((table) => [table.name, records(table)])) });
  const axis = onOneAxis(put(stored), put(tried));
  const { searchLayers, searches } = axis.counted;
  const at = { layer: null, limb: null, parameter: null, particle: null, camera: null, over: of === 'run',
    ...axis.counted, layers: searchLayers * searches, label: (name) => name, room: 300, tried: axis.tried,
    score: ['log weight', 'nats'],
    ...selection };
  at.layer = axis.there(at.layer);
  const drawing = view === 'why' ? (sheet, tables, at) => drawLimbs(sheet, tables, at, at.room)
    : { ...SEARCH_VIEWS, ...ANSWER_VIEWS }[view][of];
  const sheet = new Sheet(1180);
  const words = drawing(sheet, axis.stored, at);
  const texts = [];
  if (written) {
    const size = { width: 1180, height: Math.max(sheet.height, 300) };
    const chart = echarts.init(null, null, { renderer: 'svg', ssr: true, ...size });
    chart.setOption({ ...looks.look(), ...sheet.option });
    const svg = new DOMParser().parseFromString(chart.renderToSVGString(), 'image/svg+xml');
    texts.push(...[...svg.querySelectorAll('text')].map((one) => one.textContent));
  }
  const click = (series, event) => sheet.clicks.get(sheet.option.series[series].id)?.(event);
  const clicked = sheet.option.series.map((one, at) => {
    const last = one.data?.at(-1);
    try { return click(at, { dataIndex: (one.data ?? []).length - 1, data: last, value: last }); }
    catch { return null; } });
  const { back } = axis;
  const layers = clicked.map((one) => (Number.isInteger(one?.layer) ? back(one.layer) : null));
  const across = sheet.option.xAxis.map(({ type, data, axisLabel }) =>
    type === 'category' ? data.map((value) => axisLabel.formatter?.(value) ?? value) : null);
  const { series, visualMap: scales, title, legend: legends } = sheet.option;
  const titles = title.map((one) => one.text);
  return JSON.parse(JSON.stringify({ words, axes: across, texts, layers, series, scales, titles, legends })); }"""

COMPARE = """async ([answers, frame, chosen]) => {
  const [{ Sheet }, { drawCompared, lastSearch }] =
    await Promise.all(['js/view_sheet.js', 'js/studio/comparing_drawing.js'].map((name) => import('/' + name)));
  const sheet = new Sheet(1180);
  const runs = Object.keys(answers);
  const layered = runs.map((run) => ({ run, layers: lastSearch(answers[run]) }));
  const curves = runs.map((run) => ({ run, frame, error: null, log_weight: -1 }));
  drawCompared(sheet, { curves, runs, frame, layer: chosen, layered }, 300);
  const axis = sheet.option.xAxis[2].data;
  const lines = sheet.option.series.filter((one) => one.xAxisIndex === 2 && one.type === 'line');
  const click = (dataIndex) => sheet.clicks.get(lines[0].id)({ dataIndex }).layer;
  return { axis, lines: lines.map((one) => one.data), clicked: axis.map((_, at) => click(at)) }; }"""


class Drawings:
    """A blank page that has the pages' modules."""

    def __init__(self, browser: Browser) -> None:
        self._context = browser.new_context()
        self._context.route(f"{ADDRESS}**", _answer)
        self.page = self._context.new_page()
        self.page.goto(ADDRESS)

    def close(self) -> None:
        self._context.close()

    def draw(
        self,
        view: str,
        stored: Viewed,
        tried: Viewed | None = None,
        *,
        frame: int,
        of: str = "frame",
        selection: Selection | None = None,
        written: bool = False,
    ) -> dict[str, Any]:
        """What a view draws. words : the sentence on what is chosen. texts : all that is written in the picture, if it
        is `written`. layers : of each series the layer that a click on its last entry chooses.
        axes : the labels of the horizontal axes of categories. series, scales, titles, legends : as ECharts takes them.
        """
        chosen = (
            {} if selection is None else {"layer": selection.layer, "parameter": selection.parameter or None}
        )
        tables = [answered(stored), None if tried is None else answered(tried)]
        return self.page.evaluate(DRAW, [view, of, *tables, {**chosen, "frame": frame}, written])

    def compare(self, answers: dict[str, Viewed], frame: int, layer: int | None = None) -> dict[str, Any]:
        """How runs are compared layer by layer. answers : their views `schedule` of the frame. axis : the numbers of
        the layers. lines : by run. clicked : the layer that each place of the first run chooses.
        """
        named = {run: answered(viewed) for run, viewed in answers.items()}
        return self.page.evaluate(COMPARE, [named, frame, layer])


def clouds_of(run: InspectedRun, frame: int, selection: Selection) -> Viewed:
    """View `clouds` as the page takes it: all layers of the selected parameter beside the first and last set of all."""
    whole, found = (look(run, frame, "clouds", one) for one in (Selection(), selection))
    steps = replace(found.table("summary"), name="own")
    every = (whole.table("summary"), steps, found.table("ridges"), whole.table("marks"))
    return replace(found, tables=every)


def answered(viewed: Viewed) -> dict[str, Any]:
    """As the API answers."""
    tables = [
        {"name": one.name, "columns": [{"key": column.key} for column in one.columns], "rows": list(one.rows)}
        for one in viewed.tables
    ]
    found = {"tables": tables, "search_layers": viewed.search_layers, "searches": viewed.searches}
    return json.loads(json.dumps(found, default=float), parse_constant=lambda _: None)


def _answer(route: Route) -> None:
    path = urlsplit(route.request.url).path.lstrip("/")
    file = assets_folder() / path
    if not path:
        route.fulfill(body=BLANK, content_type="text/html")
    elif file.is_file():
        route.fulfill(body=file.read_bytes(), content_type=TYPES.get(file.suffix, "application/octet-stream"))
    else:
        route.fulfill(status=404)
