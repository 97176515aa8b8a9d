// The one time that every part of the page of a finished run shows, and what changes it.
const clock = {time: 0, end: 0, playing: false, shows: []};
const EPSILON = 1e-6;
// Length of a step, and the largest one to an image [s].
const STEP = 0.2, IMAGE_STEP = 0.45;
// Longest time between two frames that counts [s]: a page that was hidden goes on from where it was.
const LONGEST_FRAME = 0.25;

// The index of the last of sorted numbers that is at most a limit, or 0.
function lastUpTo(sorted, limit) {
  let low = 0, high = sorted.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (sorted[middle] <= limit) low = middle; else high = middle - 1;
  }
  return low;
}
function nearest(sorted, value) {
  const i = lastUpTo(sorted, value);
  return i + 1 < sorted.length && sorted[i + 1] - value < value - sorted[i] ? i + 1 : i;
}
function draw() {
  for (const showTime of clock.shows) showTime(clock.time);
  const {time, end, playing} = clock;
  $("time").value = time;
  $("time").setAttribute("aria-valuetext", `${time.toFixed(2)} of ${end.toFixed(2)} seconds`);
  write($("clock"), `${time.toFixed(2)} / ${end.toFixed(2)} s`);
  write($("play"), playing ? "\u275A\u275A" : "\u25B6");
  $("play").setAttribute("aria-label", playing ? "pause" : "play");
}
function seek(time, playing = false) {
  clock.time = Math.min(clock.end, Math.max(0, time));
  clock.playing = playing && clock.time < clock.end;
  draw();
}
function toggle() { seek(!clock.playing && clock.time >= clock.end ? 0 : clock.time, !clock.playing); }
// The neighbour of the present time among sorted times, in a direction of -1 or 1; none if there is no other.
function neighbour(times, direction) {
  return direction > 0 ? times.find((t) => t > clock.time + EPSILON)
    : times.findLast((t) => t < clock.time - EPSILON);
}
function jump(times, direction) {
  const time = neighbour(times, direction);
  if (time !== undefined) seek(time);
}
// A step leads to the next image of the cameras that are shown, so that it shows the instant of the 3-D view.
function step(direction) {
  const image = neighbour(stillTimes, direction);
  const near = image !== undefined && Math.abs(image - clock.time) < IMAGE_STEP;
  seek(near ? image : clock.time + STEP * direction);
}

function startPlayer({times, values, units, watched, rows, events}) {
  const animator = viewer.animator;
  animator.pause();
  $("time").max = clock.end;
  // Of every column the page holds the indices at which its text changes, and the texts from there on.
  const at = (index) => ([starts, texts]) => texts[lastUpTo(starts, index)];
  clock.shows.push((time) => animator.seek(time), (time) => {
    const now = at(lastUpTo(times, time + EPSILON));
    const byUnit = Object.entries(units).map(([name, columns]) => [name, columns.map(now)]);
    follow(now(watched));
    show({values: values.map(now), units: Object.fromEntries(byUnit)});
  });
  showPhases(rows);
  startKeys(rows, events.map((event) => event.time));
  $("play").onclick = toggle;
  $("back").onclick = () => step(-1);
  $("forward").onclick = () => step(1);
  $("time").oninput = () => {
    const wanted = Number($("time").value), image = stillTimes[nearest(stillTimes, wanted)];
    seek(Math.abs(image - wanted) <= STEP ? image : wanted);
  };
  let previous = null;
  requestAnimationFrame(function tick(now) {
    if (clock.playing && previous !== null) {
      const elapsed = Math.min((now - previous) / 1000, LONGEST_FRAME);
      seek(clock.time + Number($("speed").value) * elapsed, true);
    }
    previous = now;
    requestAnimationFrame(tick);
  });
  // "#t=3.5" opens the page paused at that time, so that an instant of a run can be linked to.
  function followLink() {
    const wanted = /^#t=(\d*\.?\d+)$/.exec(location.hash);
    if (wanted) seek(Number(wanted[1]));
    return wanted;
  }
  addEventListener("hashchange", followLink);
  if (!followLink()) seek(0, !matchMedia("(prefers-reduced-motion)").matches);
}

function showPhases(rows) {
  $("phases").className = rows.length > 1 ? "many" : "";
  for (const pieces of rows) {
    const row = add($("phases"), "div");
    for (const {name, from, to, colour, waits} of pieces) {
      const piece = add(row, "button", name);
      const ground = waits ? `repeating-linear-gradient(135deg, ${colour} 0 3px, #8a939c 3px 4px)` : colour;
      piece.style.cssText = `width:${100 * (to - from) / Math.max(clock.end, 1e-9)}%;background:${ground}`;
      piece.title = `${name}, ${from.toFixed(2)} s to ${to.toFixed(2)} s`;
      piece.type = "button";
      // The rows of many units would be a hundred stops of the tabulator; Page Up and Page Down reach them.
      piece.tabIndex = rows.length > 1 ? -1 : 0;
      piece.onclick = () => seek(from);
    }
  }
}
function startKeys(rows, eventTimes) {
  const index = () => rows.length > 1 ? Math.max(0, Object.keys(data.colours).indexOf(chosen)) : 0;
  const phases = () => rows[index()].map(({from}) => from);
  addEventListener("keydown", (event) => {
    const {target, shiftKey} = event, tag = target.tagName;
    const key = event.key.length > 1 ? event.key : event.key.toLowerCase();
    if (event.ctrlKey || event.altKey || event.metaKey || tag === "SELECT") return;
    const direction = {ArrowLeft: -1, ArrowRight: 1, p: -1, n: 1, PageUp: -1, PageDown: 1}[key];
    if (key === " " && tag !== "BUTTON" && tag !== "SUMMARY") toggle();
    else if (key.startsWith("Arrow") && direction) {
      if (shiftKey) seek(clock.time + direction); else step(direction);
    } else if (key.startsWith("Page")) jump(phases(), direction);
    else if (direction) jump(eventTimes, direction);
    else return;
    event.preventDefault();
  });
}
