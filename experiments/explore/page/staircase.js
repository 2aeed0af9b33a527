/* A test of what one person notices: trials by a staircase, and the threshold that their answers tell.

   Two cars differ by a level of one parameter, and the person says which has more of it. Two right answers lower the
   level, a wrong one raises it (Levitt, Transformed up-down methods in psychoacoustics, 1971), and until the first
   wrong one every right one lowers it. The threshold is the level that is told in three of four trials. Its distribution
   follows from all answers by Bayes' rule, over thresholds that are equally likely in ratios, and over slopes, of

       P(right) = chance + (1 - chance - lapse) (1 - 2^-((level / threshold)^slope))                               */

"use strict";

/** @param {any} declared the part "blind" of what Python declares */
function steerStaircase(declared) {
  const { chance, lapse, slopes, confidence, trials, reversals, steps, least, most } = declared, GRID = 240;

  class Staircase {
    constructor() {
      this.level = 1;  // of the largest difference that the page has
      /** @type {{level: number, right: boolean}[]} */
      this.answers = [];
      this.reversals = this.row = 0;
      this.down = true;
    }

    /** Whether no further trial is needed. */
    over() {
      return this.answers.length >= trials || this.reversals >= reversals;
    }

    /** Take an answer, and move to the level of the next trial. @param {boolean} right */
    answer(right) {
      this.answers.push({ level: this.level, right });
      this.row = right ? this.row + 1 : 0;
      const first = this.reversals === 0 && this.answers.every((each) => each.right);
      if (right && !first && this.row < 2) return;
      this.row = 0;
      if (right !== this.down) this.reversals += 1;
      this.down = right;
      const step = steps[first ? 0 : 1];
      this.level = Math.min(right ? this.level / step : this.level * step, 1);
    }

    /** Median and interval of the threshold, as parts of the largest difference. */
    threshold() {
      const levels = Array.from({ length: GRID }, (_, k) => least * (most / least) ** (k / (GRID - 1)));
      /** @type {number[][]} */
      const logs = levels.map((t) => slopes.map((/** @type {number} */ slope) => this.answers.reduce((sum, each) => {
        const p = chance + (1 - chance - lapse) * (1 - 2 ** -((each.level / t) ** slope));
        return sum + Math.log(each.right ? p : 1 - p);
      }, 0)));
      const top = Math.max(...logs.flat());
      const weights = logs.map((row) => row.reduce((sum, one) => sum + Math.exp(one - top), 0));
      const whole = weights.reduce((a, b) => a + b, 0);
      const at = (/** @type {number} */ share) => {
        let sum = 0;
        const k = weights.findIndex((weight) => (sum += weight / whole) >= share);
        return levels[k < 0 ? GRID - 1 : k];
      };
      const tail = (1 - confidence) / 2;
      return { low: at(tail), middle: at(0.5), high: at(1 - tail) };
    }
  }

  return { Staircase };
}
