/* The handwheel angle that a device wants, at 1 kHz, and hands that follow it smoothly.

   Rates and ranges are those of the devices of steer_env.live. In place of its arms, whose torque turns the wheel, the
   hands follow by a critically damped filter of the same delay, as the page prescribes the angle. */

"use strict";

/** @typedef {{device: string, left: boolean, right: boolean, axis: number, touched: boolean, range: number,
 *             deadZone: number, invert: boolean}} Held what is held of a device; axis -1 at the left to 1 [1], range [deg] */

/** @param {any} declared the part "drive" of what Python declares */
function steerHands(declared) {
  const RADIANS = Math.PI / 180;
  const { keyboard, mouse, gamepad } = declared.devices, h = declared.sampleTime;
  const decay = 2 / declared.hands.lag;  // of the filter, whose delay is twice its time constant [1/s]
  const limited = (/** @type {number} */ value, /** @type {number} */ most) => Math.min(Math.max(value, -most), most);

  /** What an axis wants beyond the dead zone around its middle, left positive [1]. @param {Held} held */
  function stick(held) {
    const beyond = Math.max(Math.abs(held.axis) - held.deadZone, 0) / (1 - held.deadZone);
    return (held.invert ? 1 : -1) * Math.sign(held.axis) * Math.min(beyond, 1);
  }

  class Hands {
    constructor() {
      /** @type {Held} */
      this.held = { device: "keyboard", left: false, right: false, axis: 0, touched: false,
        range: keyboard.range_deg, deadZone: declared.deadZone, invert: false };
      this.wanted = this.angle = this.speed = 0;  // [rad], [rad], [rad/s]
      this.zero = this.straight = 0;  // where a wheel is straight ahead, and where that moves to [rad]
    }

    /** A drag by so many pixels to the right. @param {number} pixels */
    drag(pixels) {
      this.wanted = limited(this.wanted - mouse.deg_per_pixel * RADIANS * pixels, this.held.range * RADIANS);
    }

    /** Angle of a wheel as it stands [rad]. */
    reading() {
      return 0.5 * this.held.range * RADIANS * stick(this.held);
    }

    /** What is wanted becomes straight ahead; a wheel's angle goes there slowly. */
    recentre() {
      if (this.held.device === "wheel") this.straight = this.reading();
      else this.wanted = 0;
    }

    /** Take hold of a handwheel where it is. @param {number} angle [rad] @param {number} speed [rad/s] */
    grip(angle, speed) {
      this.wanted = this.angle = angle;
      this.speed = speed;
      this.zero = this.reading() - angle;
    }

    /** Take another device, or what is held of it. @param {Held} held */
    take(held) {
      const other = held.device !== this.held.device;
      this.held = held;
      if (other) {
        this.straight = 0;
        this.grip(this.angle, this.speed);
      }
    }

    /** Advance by a sample. */
    step() {
      this.want();
      const e = this.angle - this.wanted, slope = this.speed + decay * e, shrunk = Math.exp(-decay * h);
      this.angle = this.wanted + (e + slope * h) * shrunk;
      this.speed = (this.speed - decay * slope * h) * shrunk;
    }

    want() {
      const { device, left, right, touched, range } = this.held, back = keyboard.return_deg * RADIANS * h;
      if (device === "wheel") {
        this.zero += limited(this.straight - this.zero, declared.hands.recentred * h);
        this.wanted = this.reading() - this.zero;
      } else if (device === "gamepad") {
        const one = stick(this.held), target = range * RADIANS * Math.sign(one) * Math.abs(one) ** gamepad.exponent;
        this.wanted += limited(target - this.wanted, gamepad.rate_deg * RADIANS * h);
      } else if (device === "keyboard" && left !== right) {
        const turned = this.wanted + (left ? 1 : -1) * keyboard.rate_deg * RADIANS * h;
        this.wanted = limited(turned, range * RADIANS);
      } else if ((device === "keyboard" && !left) || (device === "touch" && !touched)) {
        this.wanted = Math.sign(this.wanted) * Math.max(Math.abs(this.wanted) - back, 0);
      }
    }
  }

  return { Hands, stick };
}
