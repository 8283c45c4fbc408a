// Names over an arrangement where there is room for them: those that come first stay, others move down or are left out.
"use strict";
const NameTags = (() => {
  const STEP = 7, STEPS = 10, ABOVE = 4; // pixels that a name moves down by, how often, and above its place

  return class {
    constructor(box) { Object.assign(this, { box, tags: [] }); }

    // rank: those with less come first.
    add(text, place, part, colour, rank) {
      const element = document.createElement("span");
      element.className = "name-tag";
      element.textContent = text;
      element.style.color = colour;
      this.box.append(element);
      this.tags.push({ element, place, part, rank, width: element.offsetWidth, height: element.offsetHeight });
      this.tags.sort((a, b) => a.rank - b.rank);
    }

    draw(viewer, shown) {
      const { clientWidth: width, clientHeight: height } = this.box, taken = [];
      for (const { element, place, part, width: wide, height: high } of this.tags) {
        const at = place.clone().project(viewer);
        const [x, y] = [(at.x + 1) / 2 * width - wide / 2, (1 - at.y) / 2 * height - high - ABOVE];
        const seen = shown(part) && Math.max(Math.abs(at.x), Math.abs(at.y), Math.abs(at.z)) < 1;
        const free = (top) => taken.every((other) => x + wide < other.x || other.x + other.wide < x
          || top + high < other.top || other.top + other.high < top);
        const drop = seen ? Array.from({ length: STEPS }, (_, step) => y + step * STEP).find(free) : undefined;
        element.hidden = drop === undefined;
        if (drop === undefined) continue;
        taken.push({ x, top: drop, wide, high });
        element.style.transform = `translate(${x}px, ${drop}px)`;
      }
    }
  };
})();
