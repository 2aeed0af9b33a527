/* Cars of which one drives, and how another takes over without a jump: as steer_env.live.real_time.configurations does it
   for hands that give an angle. The next car receives the states of the acting one and runs beside it, and then every
   channel fades from one to the other. */

"use strict";

/** @typedef {{label: string, key: string, numbers: Float64Array, start: Float64Array, shown: Float64Array}} Configuration
 *             packed numbers, states and channels of straight running */
/** @typedef {{source: Int32Array, scale: Float64Array, shift: Float64Array}} HandOver */

/** @param {any} declared the part "drive" of what Python declares */
function steerExchange(declared) {
  const { runIn, fade, largestStep, longest, implausible, farthest } = declared.exchange;
  const { same, fromSettled, wheelSpeed, carSpeed, own } = declared.exchange;
  const names = declared.recording.channels.map((/** @type {string[]} */ each) => each[0]);
  const TORQUE = names.indexOf("torsion_bar_torque");
  const ANGLE = 1, SPEED = 2, TORQUE_OF_HANDS = 0;  // among what a car is given

  /** The name of a quantity that a chassis may call otherwise. @param {string} name */
  function common(name) {
    const found = Object.keys(same).find((each) => name.startsWith(each));
    return found === undefined ? name : name.replace(found, same[found]);
  }

  /** Whether a part of two cars has the same structure and the same numbers.
      @param {any} a @param {any} b @param {string} field */
  function equal(a, b, field) {
    if (field === "friction" && a.structure.law !== b.structure.law) return false;
    if (field === "chassis" && a.structure.chassis !== b.structure.chassis) return false;
    const [one, other] = [a, b].map(({ structure, numbers }) => numbers.slice(...structure.drive.fields[field]));
    return one.length === other.length && one.every((/** @type {number} */ v, /** @type {number} */ k) => v === other[k]);
  }

  /** Where each state of the next car comes from in the old one, -1 for its own of straight running, what it is
      multiplied by and what is added. @param {any} old @param {any} next each with structure, numbers and start
      @returns {HandOver} */
  function handOver(old, next) {
    const places = new Map(old.structure.drive.states.map((/** @type {string} */ name, /** @type {number} */ i) =>
      [common(name), i]));
    old.structure.drive.states.forEach((/** @type {string} */ name, /** @type {number} */ i) => places.set(name, i));
    const kept = Object.keys(own).filter((name) => !equal(old, next, own[name]));
    /** @type {string[]} */
    const states = next.structure.drive.states;
    const found = {
      source: new Int32Array(states.length).fill(-1),
      scale: new Float64Array(states.length).fill(1),
      shift: new Float64Array(states.length),
    };
    const speeds = [old, next].map(({ structure, start }) => start[structure.drive.states.indexOf(carSpeed)]);
    states.forEach((name, k) => {
      const i = places.get(name) ?? places.get(common(name)) ?? -1;
      if (i < 0 || kept.some((each) => name.startsWith(each))) return;
      found.source[k] = i;
      if (fromSettled.some((/** @type {string} */ each) => name.startsWith(each))) {
        found.shift[k] = next.start[k] - old.start[i];
      } else if (name.startsWith(wheelSpeed) && !/_(derivative|before)$/.test(name) &&
          Math.min(...[...speeds, old.start[i]].map(Math.abs)) > 1) {  // at rest, no radius can be told
        found.scale[k] = (next.start[k] / speeds[1]) / (old.start[i] / speeds[0]);
      }
    });
    return found;
  }

  class Exchange {
    /** @param {(key: string, place: number) => any} carAt an instance of simulation.js; two for each key, of which one
            acts while the other follows */
    constructor(carAt) {
      this.carAt = carAt;
      /** @type {Configuration[]} */
      this.configurations = [];
      this.acting = this.wanted = this.taken = 0;
      this.next = -1;
      this.place = this.age = this.share = this.dropped = 0;
      this.back = this.stopped = false;  // whether the fade goes back, and whether the next car was dropped
      this.hold = true;  // whether hands hold the wheel
      this.shown = new Float64Array(names.length);
      this.nextRow = new Float64Array(names.length);
    }

    /** Begin with a configuration in straight running. @param {number} index */
    begin(index) {
      this.acting = this.wanted = this.taken = index;
      this.next = -1;
      this.share = 0;
      this.load(index, this.place, this.configurations[index].start);
      this.shown.set(this.configurations[index].shown.subarray(0, names.length));
    }

    /** @param {number} index @param {number} place @param {Float64Array} state */
    load(index, place, state) {
      const { key, numbers } = this.configurations[index], car = this.carAt(key, place);
      car.numbers.set(numbers);
      car.state.set(state);
      this.setHold(car);
    }

    /** @param {any} car */
    setHold(car) {
      car.numbers[car.structure.drive.fields.robot[0]] = this.hold ? 1 : 0;
    }

    /** The car that acts. */
    car() {
      return this.carAt(this.configurations[this.acting].key, this.place);
    }

    /** Hold the wheel, or let it go, where no other car takes over just now; whether it was done. @param {boolean} hold */
    grip(hold) {
      if (this.next >= 0) return false;
      this.hold = hold;
      this.setHold(this.car());
      return true;
    }

    /** Let another configuration take over, as soon as hands hold the wheel. @param {number} index */
    choose(index) {
      this.wanted = index;
    }

    /** Take the last choice. */
    take() {
      const chosen = this.wanted;
      if (this.share > 0) {  // within a fade, only one of its two cars
        if (chosen === this.acting) this.back = true;
        else if (chosen === this.next && !this.stopped) this.back = false;
        else return;
      } else if (chosen === this.acting) {
        this.next = -1;
      } else if (chosen !== this.next) {
        const acting = this.configurations[this.acting], following = this.configurations[chosen];
        const old = this.car(), to = this.carAt(following.key, 1 - this.place);
        const { source, scale, shift } = handOver(
          { structure: old.structure, ...acting }, { structure: to.structure, ...following });
        const begun = following.start.map((value, k) =>
          source[k] < 0 ? value : scale[k] * old.state[source[k]] + shift[k]);
        this.load(chosen, 1 - this.place, begun);
        this.next = chosen;
        this.age = 0;
        this.back = this.stopped = false;
      }
      this.taken = chosen;
    }

    /** Advance by a sample; whether the acting car stays finite.
        @param {{torque: number, angle: number, speed: number, others: [number, number][]}} given torque of the hands, or
            angle and speed of the handwheel at the sample's end; further inputs by their places */
    sample(given) {
      if (this.taken !== this.wanted && this.hold) this.take();
      const switching = this.next >= 0, fading = switching && this.age >= runIn;
      if (switching) this.age += 1;
      const car = this.car();
      this.give(car, given);
      if (!car.advance(1)) return false;
      if (switching && !this.stopped) this.runNext(given);
      if (fading) this.fade(car.outputs);
      const row = this.car().outputs;
      for (let j = 0; j < this.shown.length; j++) {
        this.shown[j] = row[j] + (this.share > 0 ? this.share * (this.nextRow[j] - row[j]) : 0);
      }
      return true;
    }

    /** @param {any} car @param {any} given */
    give(car, given) {
      car.given[TORQUE_OF_HANDS] = given.torque;
      car.given[ANGLE] = given.angle;
      car.given[SPEED] = given.speed;
      for (const [place, value] of given.others) car.given[place] = value;
    }

    /** Advance the next car beside the acting one; one that makes no sense shows from now on what it showed last.
        @param {any} given */
    runNext(given) {
      const car = this.carAt(this.configurations[this.next].key, 1 - this.place), row = car.outputs;
      this.give(car, given);
      const finite = car.advance(1) && row.subarray(0, this.nextRow.length).every(Number.isFinite);
      if (finite && Math.abs(row[TORQUE]) <= implausible && this.age <= runIn + longest) {
        this.nextRow.set(row.subarray(0, this.nextRow.length));
        return;
      }
      this.dropped += 1;
      this.stopped = this.back = true;
      this.wanted = this.taken = this.acting;
      if (this.share === 0) this.next = -1;
      const held = this.car().outputs[TORQUE];
      this.nextRow[TORQUE] = Math.min(Math.max(this.nextRow[TORQUE], held - farthest), held + farthest);
    }

    /** Move the share of the next car; at its end that car acts. @param {Float64Array} row of the acting car */
    fade(row) {
      const difference = Math.abs(this.nextRow[TORQUE] - row[TORQUE]);
      const change = Math.min(1 / fade, difference > 0 ? largestStep / difference : Infinity);
      this.share = Math.min(Math.max(this.share + (this.back ? -change : change), 0), 1);
      if (this.share === 0) {
        this.next = -1;
      } else if (this.share >= 1 - 1e-9) {  // a sum of hundredths is not exactly 1
        this.acting = this.next;
        this.place = 1 - this.place;
        this.next = -1;
        this.share = 0;
      }
    }
  }

  return { Exchange, handOver };
}
