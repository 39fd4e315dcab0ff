// The page on this machine: the model of a widget, whose commands go to the server.
import app from "./app.js";

const held = {};
const heard = {};
const model = {
  get: (name) => held[name],
  set: (name, value) => { held[name] = value; },
  on: (name, call) => { (heard[name] ??= []).push(call); },
  save_changes: () => post(held.command),
};

async function post(command) {
  const lost = "the program does not answer: it may have ended, or the machine slept. Start it again, or reload the page";
  try {
    const answer = await fetch("command", {
      method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(command),
    });
    held.answer = { id: command.id, ...(answer.ok ? await answer.json() : { error: lost }) };
  } catch {
    held.answer = { id: command.id, error: lost };
  }
  for (const call of heard["change:answer"] ?? []) call();
}

app.render({ model, el: document.getElementById("app") });
