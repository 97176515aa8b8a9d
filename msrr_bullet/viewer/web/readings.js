// Readings as text: of the trial, of all units of a mission, and of the unit that was chosen.
document.title = "msrr: " + data.title;
document.querySelector("h1").textContent = data.title;
$("description").textContent = data.description;

function addKey(parent, [name, colour, dashed]) {
  const key = add(parent, "div", "", "key"), line = add(key, "i");
  line.style.background = line.style.borderColor = colour;
  line.className = dashed ? "dashed" : "";
  add(key, "span", name);
}
themed.push(() => {
  $("legend").replaceChildren();
  for (const [name, colour] of data.legend) addKey($("legend"), [name, inkOf(colour)]);
});

function pairs(table, labels) {
  return labels.map((label) => {
    const row = table.insertRow();
    row.insertCell().textContent = label;
    return row.insertCell();
  });
}
const cells = pairs($("values"), data.readings);
const chosenCells = pairs($("unit"), data.unitReadings), unitRows = {};
const choices = [];  // functions that show the unit that was chosen
let chosen = null, latest = null, picked = false;  // picked: by the reader, not by the page
if (data.headings.length) {
  const head = $("units").insertRow();
  for (const heading of data.headings) add(head, "th", heading);
  for (const [name, colour] of Object.entries(data.colours)) {
    const row = unitRows[name] = $("units").insertRow();
    for (const _ of data.headings) row.insertCell();
    add(row.cells[0], "i").style.background = colour;
    add(row.cells[0], "b");
    row.onclick = () => pick(name);
  }
}
// Units between which one chooses are those that do something; a page of a single one needs no choice.
for (const name of data.choice) add($("chosen"), "option", name).value = name;
$("choice").hidden = data.choice.length < 2;
$("chosen").onchange = () => pick($("chosen").value);
// Until the reader picks a unit, the page shows the one that docks.
function follow(name) {
  if (!picked && name !== chosen && data.choice.includes(name)) choose(name);
}
function pick(name) {
  picked = true;
  choose(name);
}
function choose(name) {
  if (unitRows[chosen]) unitRows[chosen].className = "";
  chosen = $("chosen").value = name;
  if (unitRows[name]) unitRows[name].className = "chosen";
  if (latest) show(latest);
  for (const choice of choices) choice();
}
function write(cell, text) { if (cell.textContent !== text) cell.textContent = text; }
function show(message) {
  latest = message;
  message.values.forEach((value, i) => write(cells[i], value));
  for (const [name, texts] of Object.entries(message.units)) {
    data.headings.forEach((_, i) => {
      write(i ? unitRows[name].cells[i] : unitRows[name].cells[0].lastChild, texts[i]);
    });
    unitRows[name].title = texts[texts.length - 1];
    if (name === chosen) chosenCells.forEach((cell, i) => write(cell, texts[data.headings.length + i]));
  }
}
