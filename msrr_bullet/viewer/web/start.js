// What the page begins with: a finished run has its data in the page, a live page gets them from the server.
function bytes(base64) { return Uint8Array.from(atob(base64), (c) => c.charCodeAt(0)); }
function live() {
  const socket = new WebSocket(`ws://${location.host}/feed`);
  socket.binaryType = "arraybuffer";
  socket.onmessage = ({data: message}) => {
    if (typeof message === "string") {
      if (!latest) setTheme(isDark());  // the scene has come before the first reading
      show(JSON.parse(message));
    }
    else viewer.handle_command_bytearray(new Uint8Array(message));
    fit();
  };
  socket.onclose = () => { $("description").textContent = "The run has ended."; };
}
document.body.className = data.replay ? "replay" : "live";
for (const command of data.commands) viewer.handle_command_bytearray(bytes(command));
if (data.replay) {
  document.body.classList.toggle("wide", data.headings.length > 0);
  clock.end = data.replay.end;
  startCameras(data.replay);
  startPlots(data.replay);
  startEvents(data.replay);
  new ResizeObserver(() => {
    document.documentElement.style.setProperty("--bar", `${$("bar").offsetHeight}px`);
  }).observe($("bar"));
}
if (data.choice.length) choose(data.choice[0]);
if (data.replay) startPlayer(data.replay); else live();
setTheme(systemDark.matches);
fit();
label();
