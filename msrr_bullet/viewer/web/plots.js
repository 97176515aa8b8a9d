// Plots over time of the chosen unit, and of what no unit has alone. A click or a drag goes to that time.
// Marks of a logarithmic axis.
const DECADES = [0, 1, 2, 3, 4].flatMap((k) => [-(10 ** k), 10 ** k]).concat(0).sort((a, b) => a - b);
const LIMIT = "#8a939c";

function startPlots({plots}) {
  let built = [];
  function build() {
    for (const plot of built) plot.destroy();
    $("plots").replaceChildren();
    built = [...(Object.hasOwn(plots, chosen) ? plots[chosen] : []), ...plots[""]].map((plot) => buildPlot(plot));
  }
  choices.push(build);
  themed.push(() => { if (chosen !== null) build(); });
  clock.shows.push((time) => { for (const plot of built) placeLine(plot, time); });
  new ResizeObserver(() => {
    for (const plot of built) plot.setSize(sizeOf(plot.root.parentElement));
  }).observe($("plots"));
}
const sizeOf = (card) => ({width: Math.max(200, card.clientWidth - 12), height: 150});

function buildPlot({title, times, curves, limits, asinh}) {
  const card = add($("plots"), "div", "", "card plot"), head = add(card, "h2", title);
  const keys = add(head, "span", "", "keys");
  for (const {name, colour, dash} of curves) addKey(keys, [name, inkOf(colour), dash]);
  for (const {name, value} of limits) if (value >= 0) addKey(keys, [`${name} ${value}`, LIMIT, true]);
  const style = getComputedStyle(document.documentElement), ink = style.getPropertyValue("--faint").trim();
  const grid = {stroke: style.getPropertyValue("--line").trim(), width: 1};
  // Numbers as everywhere on the page: where the browser writes "1.000" for a thousand, the page would not.
  const axis = {stroke: ink, grid, font: "11px system-ui", values: (_, splits) => splits.map(String)};
  axis.ticks = {...axis.grid, size: 4};
  const series = curves.map(({name, colour, width, dash, stepped}) => ({
    label: name, stroke: inkOf(colour), width, dash: dash ? [4, 4] : undefined, points: {show: false},
    paths: stepped ? uPlot.paths.stepped({align: 1}) : undefined,
  }));
  // Straight lines at the limits: two points each would break the common times, so they have a value at each.
  for (const {name} of limits) {
    series.push({label: name, stroke: LIMIT, width: 1, dash: [6, 3], points: {show: false}});
  }
  const range = (_, low, high) => [1.3 * Math.min(0, low), 1.3 * Math.max(0, high)];
  const scale = asinh ? {distr: 4, asinh, range} : {};
  const logarithmic = asinh ? {splits: (_, i, low, high) => DECADES.filter((y) => !y || (low <= y && y <= high
    && Math.abs(y) > 1.5 * asinh)), filter: (_, splits) => splits} : {};
  const plot = new uPlot({
    ...sizeOf(card), series: [{}, ...series], legend: {show: false}, padding: [8, 10, 0, 0],
    scales: {x: {time: false, range: [0, clock.end]}, y: scale},
    axes: [{...axis, size: 26}, {...axis, size: 48, space: 20, ...logarithmic}],
    cursor: {drag: {x: false, y: false}, points: {show: false}},
    hooks: {draw: [(drawn) => placeLine(drawn, clock.time)]},  // before it is drawn it has no scales
  }, [times, ...curves.map(({values}) => values), ...limits.map(({value}) => times.map(() => value))], card);
  plot.root.setAttribute("role", "img");
  plot.root.setAttribute("aria-label", `${title} over time`);
  plot.now = add(plot.over, "div", "", "now");
  const follow = (event) => seek(plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, "x"));
  plot.over.addEventListener("pointerdown", (event) => {
    plot.over.setPointerCapture(event.pointerId);
    follow(event);
  });
  plot.over.addEventListener("pointermove", (event) => { if (event.buttons & 1) follow(event); });
  return plot;
}
function placeLine(plot, time) { plot.now.style.transform = `translateX(${plot.valToPos(time, "x") - 1}px)`; }
