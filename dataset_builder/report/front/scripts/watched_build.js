"use strict";
// Keeps the page of a build up to date, and says so when the build has not been heard of.
(() => {
  const STALE = 300;
  const main = () => document.querySelector("main[data-written]");

  function ago(seconds) {
    const whole = Math.max(Math.round(seconds), 0);
    if (whole < 60) return `${whole} s`;
    if (whole < 3600) return `${Math.floor(whole / 60)} min`;
    return `${Math.floor(whole / 3600)} h ${Math.floor(whole / 60) % 60} min`;
  }

  function look() {
    const { state, written } = main().dataset;
    const age = Date.now() / 1000 - Number(written);
    const stale = state === "running" && age > STALE;
    document.getElementById("age").textContent = `, ${ago(age)} ago`;
    document.querySelector("#stale span").textContent = ago(age);
    document.getElementById("stale").hidden = !stale;
    document.body.classList.toggle("stale", stale);
  }

  async function renew() {
    // A page that was opened as a file may not fetch itself
    if (location.protocol === "file:") {
      location.reload();
      return;
    }
    let away = true;
    try {
      const answer = await fetch(location.href, { cache: "no-store" });
      const page = new DOMParser().parseFromString(await answer.text(), "text/html");
      const next = page.querySelector("main[data-written]");
      if (answer.ok && next) {
        main().replaceWith(document.adoptNode(next));
        document.title = page.title;
        away = false;
      }
    } catch {
      // The server or the network is gone, for now
    }
    document.getElementById("away").hidden = !away;
    look();
  }

  look();
  setInterval(look, 1000);
  setInterval(renew, 1000 * Number(main().dataset.every));
})();
