// Annotated images of the overhead camera and of the chosen unit's camera: the nearest in time, but none that
// lies farther ahead than this [s].
const AHEAD = 0.5;
let stillTimes = [];  // of all cameras that are shown, sorted

function startCameras({stills, stillInterval}) {
  const figures = [];
  for (const kind of ["overhead", "onboard"]) {
    if (!stills.some((camera) => (camera.unit === null) === (kind === "overhead"))) continue;
    const figure = add($("cameras"), "figure", "", "card"), image = add(add(figure, "div"), "img");
    const caption = add(figure, "figcaption"), name = add(caption, "b");
    const when = add(caption, "span"), found = add(caption, "span", "", "found");
    const legend = add(figure, "details");
    add(legend, "summary", "colours");
    image.decoding = "sync";
    figures.push({kind, figure, image, name, when, found, legend});
  }
  const cameraOf = (kind) => stills.find(({unit}) => unit === (kind === "overhead" ? null : chosen));
  function showStill({kind, figure, image, when, found}, time) {
    const camera = cameraOf(kind);
    if (!camera) return;
    const near = nearest(camera.times, time);
    const i = camera.times.length && camera.times[near] <= time + AHEAD ? near : near - 1;
    const taken = camera.times[i], age = time - taken;
    image.style.visibility = i < 0 ? "hidden" : "";
    if (i < 0) {
      image.dataset.time = image.alt = "";
      write(when, "not looking yet");
      write(found, "");
      return;
    }
    const file = `data:image/${camera.kind};base64,${camera.images[i]}`;
    if (image.src !== file) image.src = file;
    image.dataset.time = taken;
    image.alt = `${camera.name} camera at ${taken.toFixed(2)} s: ${camera.texts[i]}`;
    write(found, found.title = camera.texts[i]);
    figure.classList.toggle("stale", Math.abs(age) > Math.max(1, stillInterval));
    const apart = Math.abs(age) < 0.005 ? "" : ` (${Math.abs(age).toFixed(2)} s ${age > 0 ? "ago" : "later"})`;
    write(when, `${taken.toFixed(2)} s${apart}`);
  }
  function showAll() {
    const shown = figures.map(({kind}) => cameraOf(kind)).filter((camera) => camera);
    stillTimes = shown.flatMap(({times}) => times).sort((a, b) => a - b);
    for (const each of figures) {
      const camera = cameraOf(each.kind);
      each.figure.hidden = !camera;
      each.name.textContent = camera ? camera.name : "";
      while (each.legend.childElementCount > 1) each.legend.lastChild.remove();
      for (const key of camera ? camera.legend : []) addKey(each.legend, key);
      showStill(each, clock.time);
    }
  }
  choices.push(showAll);
  clock.shows.push((time) => { for (const each of figures) showStill(each, time); });
  // A live page gets the newest image of a camera in place of the one before.
  return (still) => {
    Object.assign(stills.find(({name}) => name === still.name), still);
    showAll();
  };
}
