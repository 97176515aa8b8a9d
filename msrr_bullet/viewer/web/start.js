// What the page begins with: a finished run has its data in the page, a live page gets them from the server.
function bytes(base64) { return Uint8Array.from(atob(base64), (c) => c.charCodeAt(0)); }
function live(showNewest) {
  const socket = new WebSocket(`ws://${location.host}/feed`);
  socket.binaryType = "arraybuffer";
  socket.onmessage = ({data: message}) => {
    if (typeof message === "string") {
      const {still, ...reading} = JSON.parse(message);
      if (still) showNewest(still); else showPresent(reading);
    }
    else viewer.handle_command_bytearray(new Uint8Array(message));
  };
  socket.onclose = () => { $("description").textContent = "The run has ended."; };
}
function showPresent(reading) {
  if (!latest) setTheme(isDark());  // the scene has come before the first reading
  show(reading);
  clock.time = reading.time;
  follow(reading.watched);
  for (const showTime of clock.shows) showTime(clock.time);
}
document.body.className = data.replay ? "replay" : "live";
for (const command of data.commands) viewer.handle_command_bytearray(bytes(command));
document.body.classList.toggle("wide", data.headings.length > 0);
const showNewest = startCameras(data.replay || data.live);
if (data.replay) {
  clock.end = data.replay.end;
  startPlots(data.replay);
  startEvents(data.replay);
}
// What has to stay in view beside the scene and the images: the time line, and the readings of the present.
const kept = $(data.replay ? "bar" : "hud");
new ResizeObserver(() => {
  document.documentElement.style.setProperty("--bar", `${kept.offsetHeight}px`);
}).observe(kept);
if (data.choice.length) choose(data.choice[0]);
if (data.replay) startPlayer(data.replay); else live(showNewest);
setTheme(systemDark.matches);
fit();
label();
