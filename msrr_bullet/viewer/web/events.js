// The list of events, each a jump to its time, and their marks on the time line.
function startEvents({events}) {
  const list = document.querySelector("#events ol"), times = events.map((event) => event.time);
  $("events").hidden = !events.length;
  const buttons = events.map(({time, source, text, alarm}) => {
    const button = add(add(list, "li"), "button", "", alarm ? "alarm" : ""), mark = add($("marks"), "i");
    button.type = "button";
    add(button, "time", `${time.toFixed(2)} s`);
    add(button, "span", `${source}: ${text}`);
    button.onclick = () => seek(time);
    mark.style.left = `${100 * Math.min(1, time / Math.max(clock.end, 1e-9))}%`;
    mark.className = alarm ? "alarm" : "";
    return button;
  });
  let current = null;
  clock.shows.push((time) => {
    const button = times[0] <= time + EPSILON ? buttons[lastUpTo(times, time + EPSILON)] : null;
    if (button === current) return;
    if (current) current.removeAttribute("aria-current");
    current = button;
    if (!button) return;
    button.setAttribute("aria-current", "true");
    list.scrollTop = button.offsetTop - list.offsetTop - 0.5 * list.clientHeight;
  });
}
