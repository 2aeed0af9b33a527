/* The page of a drive: it takes what devices tell to the worker, draws the newest moment, and keeps the recording. */

"use strict";

/** What is driven, for tests and for the console. @type {any} */
const steerDriven = { ready: false, worker: null, log: null, now: null, largest: 0, stands: "" };

// Commands by their keys, and what the page says of them; left and right are held.
const STEER_KEYS = [
  { keys: ["ArrowLeft", "a"], command: "left", shown: "← or A", says: "turn left" },
  { keys: ["ArrowRight", "d"], command: "right", shown: "→ or D", says: "turn right" },
  { keys: ["ArrowUp", "w", "PageUp"], command: "faster", shown: "↑ or W", says: "faster" },
  { keys: ["ArrowDown", "s", "PageDown"], command: "slower", shown: "↓ or S", says: "slower" },
  { keys: ["h"], command: "hands", shown: "H", says: "hands off, or on again" },
  { keys: ["1"], command: "set_1", shown: "1", says: "the car of this page" },
  { keys: ["2"], command: "set_2", shown: "2 to 4", says: "the cars pinned as A, B, C" },
  { keys: ["3"], command: "set_3", shown: "", says: "" },
  { keys: ["4"], command: "set_4", shown: "", says: "" },
  { keys: ["b"], command: "swap", shown: "B", says: "back to the car before" },
  { keys: ["c"], command: "recentre", shown: "C", says: "straight ahead is here" },
  { keys: ["r"], command: "road", shown: "R", says: "begin the road under the car" },
  { keys: ["v"], command: "view", shown: "V", says: "driver's view, or from above" },
  { keys: ["f"], command: "fill", shown: "F", says: "full screen" },
  { keys: ["p"], command: "pause", shown: "P", says: "stand still, or go on" },
  { keys: ["n"], command: "anew", shown: "N", says: "record anew" },
  { keys: ["t"], command: "test", shown: "T", says: "begin or end the blind test" },
  { keys: ["x"], command: "drive_x", shown: "X, Y", says: "drive X, drive Y" },
  { keys: ["y"], command: "drive_y", shown: "", says: "" },
  { keys: ["X"], command: "more_x", shown: "Shift+X, Y", says: "X has more, Y has more" },
  { keys: ["Y"], command: "more_y", shown: "", says: "" },
];

/** @param {any} declared */
async function steerDrive(declared) {
  const find = (/** @type {string} */ id) => /** @type {any} */ (document.getElementById(id));
  const status = find("status"), main = /** @type {HTMLElement} */ (document.querySelector("main"));
  const refused = (/** @type {string} */ words) => {
    status.textContent = words;
    status.classList.add("refusal");
  };
  const lacking = steerLacking();
  if (lacking) {
    refused(lacking);
    return;
  }
  const drive = declared.drive, { recording, devices, pace } = drive;
  const spaced = (/** @type {string} */ name) => name.replaceAll("_", " ");
  const address = steerAddress(declared), load = steerLoading(declared), logging = steerLog(drive), log = new logging.Log();
  const fields = steerFields(document.createElement("div"), () => {}), view = steerView(drive);
  const text = [
    ...[steerSimulation, steerExchange, steerHands, steerPolicies, steerPace].map(String),
    `const declared = ${JSON.stringify(drive)}, simulation = steerSimulation(${declared.drives.rate}, ${declared.drives.regrip});`,
    "steerPace(self, declared, simulation, steerExchange(declared), steerHands(declared), steerPolicies());",
  ].join("\n");
  const worker = new Worker(URL.createObjectURL(new Blob([`"use strict";\n${text}`], { type: "text/javascript" })));
  Object.assign(steerDriven, { worker, log, columns: logging.names });

  /** @type {Map<string, any>} */
  const structures = new Map();
  /** @type {{label: string, of: CarShown, values: Record<string, number>}[]} */
  const cars = [];
  /** @type {any} */
  let newest = null;
  let own = 0;  // cars of the address; behind them stand those of blind tests
  let stands = "begin", noted = 0, chosen = 0, before = 0, held = 0, hold = true, fromAbove = false, dropped = 0;
  let origin = { x: 0, y: 0, yaw: 0 }, passed = steerCourse(drive, "plain");

  /** Tell what happened, for some seconds. @param {string} words @param {number} [seconds] */
  function tell(words, seconds = 6) {
    find("notice").textContent = words;
    noted = performance.now() + 1e3 * seconds;
  }

  // -- cars

  const structure = load.into(worker, structures);

  /** Add a car that can be driven, at the speed of the first; sentences about what is refused.
      @param {string} label @param {CarShown} of */
  async function add(label, of) {
    const { parameters } = await structure(of.law, of.chassis), { kept, remarks } = fields.taken(parameters, of.values);
    const usual = Object.fromEntries(parameters.map((/** @type {Field} */ q) => [q.name, q.value]));
    const values = { ...usual, ...kept };
    const speed = declared.speed.name;
    if (cars.length) values[speed] = cars[0].values[speed];
    cars.push({ label, of: { law: of.law, chassis: of.chassis, values: kept }, values });
    worker.postMessage({
      configuration: { index: cars.length - 1, label, key: `${of.law} ${of.chassis}`, values },
    });
    return remarks.map((remark) => `${label}: ${remark}`);
  }

  /** What a car is, in words. @param {CarShown} of */
  function words(of) {
    const { parameters } = structures.get(`${of.law} ${of.chassis}`);
    const label = (/** @type {string} */ name) =>
      parameters.find((/** @type {Field} */ q) => q.name === name).label.split(",")[0];
    const changed = Object.entries(of.values).map(([name, value]) => `${label(name)} ${value}`);
    return [address.labels[of.law], spaced(of.chassis), ...changed].join(", ");
  }

  function list() {
    find("cars").replaceChildren(...cars.slice(0, own).map(({ label, of }, k) => {  // not those of a blind test
      const line = document.createElement("li"), button = document.createElement("button");
      button.type = "button";
      button.dataset.command = `set_${k + 1}`;
      button.setAttribute("aria-pressed", String(k === chosen));
      for (const [tag, content] of [["b", String(k + 1)], ["span", label], ["small", words(of)]]) {
        button.append(Object.assign(document.createElement(tag), { textContent: content }));
      }
      line.append(button);
      return line;
    }));
  }

  /** @param {number} index */
  function choose(index) {
    if (index === chosen || index >= cars.length) {
      if (index >= own) tell(`There is no car ${index + 1}: pin one on the page before.`);
      return;
    }
    [before, chosen] = [chosen, index];
    worker.postMessage({ choose: index });
    tell(hold ? cars[index].label : `${cars[index].label}, as soon as hands hold the wheel`);
    list();
  }

  // -- what the worker tells

  worker.onerror = ({ message }) => refused(`The car could not be run: ${message}`);
  worker.addEventListener("message", ({ data }) => {
    if ("stands" in data) {
      stand(data.stands);
      return;
    }
    log.add(data.samples);
    newest = data;
    steerDriven.largest = data.largest;
    if (data.dropped > dropped) {
      dropped = data.dropped;
      tell(`${cars[chosen].label} did not stay finite: ${cars[data.samples.at(logging.place("chosen_set") -
        logging.width) - 1].label} goes on.`);
      chosen = data.samples.at(logging.place("chosen_set") - logging.width) - 1;
      list();
    }
  });

  /** Show why the drive stands; empty where it goes on. @param {string} why */
  function stand(why) {
    stands = steerDriven.stands = why;
    find("pause").textContent = why === "" ? "Pause" : why === "begin" ? "Start" : "Go on";
    const sentences = /** @type {Record<string, string>} */ ({
      "": "",
      begin: "Press P, or Start, to drive.",
      asked: "The drive stands: P goes on.",
      hidden: "The drive stands, as the page was hidden: P goes on.",
      slow: `This computer came more than ${pace.halt} ms late, so that the drive stands; nothing was skipped. P goes on.`,
      unplugged: "The drive stands, as the device is gone: plug it in, or take another one. P goes on.",
      "not finite": "The car did not stay finite, so that the drive has ended: choose another one and load the page anew.",
    });
    if (why || noted === Infinity) tell(sentences[why], why ? Infinity : 0);
  }
  document.addEventListener("visibilitychange", () => {
    if (document.hidden) worker.postMessage({ stand: "hidden" });
  });

  // -- devices

  const keysHeld = new Set();
  /** @type {Held} */
  let told = { device: "keyboard", left: false, right: false, axis: 0, touched: false,
    range: devices.keyboard.range_deg, deadZone: 0, invert: false };

  /** @param {Partial<Held>} part */
  function hands(part) {
    told = { ...told, ...part };
    worker.postMessage({ hands: told });
  }

  /** @param {string} name */
  function steerBy(name) {
    const pad = name === "gamepad" || name === "wheel";
    find("device").value = name;
    find("pads").hidden = find("dead-row").hidden = !pad;
    find("rumble-row").hidden = name !== "gamepad";
    const range = name === "wheel" ? devices.wheel.degrees : devices[name === "touch" ? "mouse" : name].range_deg;
    find("range").value = range;
    find("dead").value = name === "gamepad" ? drive.deadZone : 0;
    find("axis").value = pad ? devices[name].steering_axis : 0;
    find("invert").checked = false;
    keysHeld.clear();
    hands({ device: name, range, deadZone: Number(find("dead").value), invert: false, axis: 0, left: false, right: false,
      touched: false });
    listPads();
  }

  for (const name of [...Object.keys(devices), "touch"]) find("device").append(new Option(name, name));
  find("device").addEventListener("change", () => steerBy(find("device").value));
  for (const id of ["range", "dead", "axis", "invert"]) {
    find(id).addEventListener("input", () => {
      const wrong = ["range", "dead", "axis"].find((each) => !find(each).checkValidity() || find(each).value === "");
      const { min, max } = find(wrong ?? "range");
      find("device-refusal").textContent = wrong ? `It must be from ${min} to ${max}, got ${find(wrong).value || "nothing"}.` : "";
      if (!wrong) hands({ range: Number(find("range").value), deadZone: Number(find("dead").value), invert: find("invert").checked });
    });
  }

  const pads = () => [...navigator.getGamepads()].filter((pad) => pad !== null);
  function listPads() {
    const now = pads();
    find("pad").replaceChildren(...now.map((pad) => new Option(pad.id, String(pad.index))));
    const needed = (told.device === "gamepad" || told.device === "wheel") && now.length === 0;
    find("device-refusal").textContent = needed ? "No device is there: plug it in and press one of its buttons." : "";
  }
  addEventListener("gamepadconnected", listPads);
  addEventListener("gamepaddisconnected", () => {
    listPads();
    if (told.device === "gamepad" || told.device === "wheel") worker.postMessage({ stand: "unplugged" });
  });

  /** Buttons of the pad that were down. @type {Set<number>} */
  let pressed = new Set();
  function readPad() {
    if (told.device !== "gamepad" && told.device !== "wheel") return;
    const pad = pads().find((each) => String(each.index) === find("pad").value);
    if (!pad) return;
    const axis = pad.axes[Number(find("axis").value)] ?? 0;
    if (axis !== told.axis) hands({ axis });
    const down = new Set(pad.buttons.flatMap((button, k) => (button.pressed ? [k] : [])));
    for (const [number, command] of Object.entries(drive.buttons)) {
      const is = down.has(Number(number)), was = pressed.has(Number(number));
      if (is === was) continue;
      if (command === "dead_man") grip(!is);  // hands are off while it is held
      else if (is) obey(command);
    }
    pressed = down;
    if (told.device === "gamepad" && find("rumble").checked && !stands) shake(pad);
  }

  let shaken = 0;
  /** Rumble with the texture of the torque: how much it departs from its mean. @param {any} pad */
  function shake(pad) {
    const now = performance.now(), { duration, full, strength } = drive.rumble;
    if (now - shaken < duration || !newest) return;
    shaken = now;
    const at = logging.place("torsion_bar_torque");
    const last = log.rows.slice(-Math.ceil(duration / (1e3 * drive.sampleTime * recording.samples))).map((row) => row[1 + at]);
    const mean = last.reduce((a, b) => a + b, 0) / last.length;
    const rough = Math.sqrt(last.reduce((sum, value) => sum + (value - mean) ** 2, 0) / last.length);
    const magnitude = strength * Math.min(rough / full, 1);
    pad.vibrationActuator?.playEffect("dual-rumble", { duration, weakMagnitude: magnitude, strongMagnitude: 0 });
  }

  const board = find("view");
  let dragged = /** @type {number | null} */ (null);
  board.addEventListener("pointerdown", (/** @type {PointerEvent} */ event) => {
    board.focus();
    if (event.pointerType === "touch") {
      if (told.device !== "touch") steerBy("touch");
      if (stands === "begin") obey("pause");
      dragged = event.clientX;
      board.setPointerCapture(event.pointerId);
      hands({ touched: true });
    } else if (told.device === "mouse" && document.pointerLockElement !== board) {
      Promise.resolve(board.requestPointerLock()).catch(() => tell("The browser does not lend the mouse."));
    }
  });
  board.addEventListener("pointermove", (/** @type {PointerEvent} */ event) => {
    if (told.device === "touch" && dragged !== null) {
      worker.postMessage({ drag: event.clientX - dragged });
      dragged = event.clientX;
    } else if (told.device === "mouse" && document.pointerLockElement === board) {
      worker.postMessage({ drag: event.movementX });
    }
  });
  for (const end of ["pointerup", "pointercancel"]) {
    board.addEventListener(end, () => {
      dragged = null;
      if (told.touched) hands({ touched: false });
    });
  }
  board.addEventListener("wheel", (/** @type {WheelEvent} */ event) => {
    if (told.device !== "mouse") return;
    event.preventDefault();
    obey(event.deltaY < 0 ? "faster" : "slower");
  }, { passive: false });

  /** @param {KeyboardEvent} event */
  function command(event) {
    const key = event.key.length === 1 && !event.shiftKey ? event.key.toLowerCase() : event.key;
    return STEER_KEYS.find(({ keys }) => keys.includes(key))?.command;
  }
  addEventListener("keydown", (event) => {
    const target = /** @type {HTMLElement} */ (event.target), name = command(event);
    if (!name || event.ctrlKey || event.altKey || event.metaKey || target.closest("input")) return;
    if (target.closest("select") && name !== "left" && name !== "right") return;  // which up and down belong to
    event.preventDefault();
    if (name === "left" || name === "right") steerKey(name, true);
    else if (!event.repeat || name === "faster" || name === "slower") obey(name);
  });
  addEventListener("keyup", (event) => {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;  // Shift may have been pressed meanwhile
    const name = STEER_KEYS.find(({ keys }) => keys.includes(key))?.command;
    if (name === "left" || name === "right") steerKey(name, false);
  });
  addEventListener("blur", () => {  // nobody tells which keys are released meanwhile
    for (const name of /** @type {("left" | "right")[]} */ (["left", "right"])) steerKey(name, false);
  });

  /** @param {"left" | "right"} name @param {boolean} down */
  function steerKey(name, down) {
    if (down === keysHeld.has(name)) return;
    if (down && told.device !== "keyboard") steerBy("keyboard");
    if (down) keysHeld.add(name);
    else keysHeld.delete(name);
    hands({ [name]: down });
  }

  // -- commands

  /** @param {boolean} wanted */
  function grip(wanted) {
    hold = wanted;
    worker.postMessage({ hold });
    find("hands").setAttribute("aria-pressed", String(!hold));
    tell(hold ? "Hands hold the wheel." : "Hands off: the wheel is free.");
  }

  /** @param {number} steps */
  function faster(steps) {
    const { of } = cars[chosen], { inputs } = structures.get(`${of.law} ${of.chassis}`).drive;
    if (!inputs.includes("target_speed")) {
      tell("The speed of a single track does not change: choose two tracks on the page before.");
      return;
    }
    held = Math.min(Math.max(held + steps * drive.held.step, 0), drive.held.fastest);
    worker.postMessage({ target: held });
    tell(`Speed held at ${Math.round(3.6 * held)} km/h.`);
  }

  /** @type {Record<string, () => void>} */
  const commands = {
    faster: () => faster(1),
    slower: () => faster(-1),
    hands: () => grip(!hold),
    swap: () => choose(before),
    recentre: () => {
      worker.postMessage({ recentre: true });
      tell("Straight ahead is here.");
    },
    road: () => {
      const now = sampleAt(Infinity);
      if (now) origin = pose(now);
      tellRoad();
      tell("The road begins anew under the car; the recording keeps its coordinates.");
    },
    pause: () => {
      if (stands === "not finite") return;
      if (stands) {
        worker.postMessage({ go: true });
        stand("");
      } else {
        worker.postMessage({ stand: "asked" });
      }
    },
    view: () => {
      fromAbove = !fromAbove;
      showView();
    },
    fill: () => {
      if (document.fullscreenElement) document.exitFullscreen();
      else board.requestFullscreen().catch(() => tell("The browser does not fill the screen."));
    },
    anew: () => {
      log.begin();
      acted.clear();
      if (find("policy").value) acted.add(find("policy").value);
      tell("The recording begins anew.");
    },
    save: () => {
      const link = document.createElement("a");
      link.href = URL.createObjectURL(new Blob([steerDriven.csv()], { type: "text/csv" }));
      link.download = "drive.csv";
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1e4);
    },
    ...Object.fromEntries([0, 1, 2, 3].map((k) => [`set_${k + 1}`, () => {
      if (blind) tell("The blind test chooses the cars: T ends it.");
      else choose(k < own ? k : cars.length);
    }])),
    test: () => guarded(blind ? endTest() : beginTest()),
    drive_x: () => blind && choose(blind.x),
    drive_y: () => blind && choose(blind.y),
    more_x: () => blind && guarded(answer(true)),
    more_y: () => blind && guarded(answer(false)),
  };
  function tellRoad() {
    worker.postMessage({ road: { origin: [origin.x, origin.y, origin.yaw], course: find("course").value } });
  }

  /** Policies of the recording. @type {Set<string>} */
  const acted = new Set();

  /** Let a policy drive or assist, or nobody. @param {string} id */
  async function beside(id) {
    const listed = declared.policies.find((/** @type {any} */ each) => each.id === id) ?? null;
    const policy = listed && await load.policy(listed.file);
    if (find("policy").value !== id) return;  // another one was chosen while this was loaded
    worker.postMessage({ policy });
    if (id) acted.add(id);
    const speeds = listed?.speeds?.map((/** @type {number} */ v) => Math.round(3.6 * v)).join(" to ");
    find("about").textContent = listed ? `${listed.about} Trained with ${spaced(listed.law)}${speeds ? `, ${speeds} km/h` : ""}. ` +
      (listed.role === "driver" ? "It drives by the torque of its hands; another car takes over once you hold the wheel."
        : "Its torque comes on top of the boost.") : "";
    tell(listed ? `${listed.id} ${listed.role === "driver" ? "drives" : "assists"}.` : "You drive without a policy.");
  }
  find("policy").append(new Option("none", ""), ...declared.policies.map((/** @type {any} */ each) =>
    new Option(`${each.id.replace("steer_env/", "")}, ${each.role}`, each.id)));
  find("policy").addEventListener("change", () => guarded(beside(find("policy").value)));

  /** @param {string} name */
  const obey = (name) => commands[name]();
  const guarded = (/** @type {Promise<any>} */ work) => work.catch((/** @type {Error} */ error) => refused(error.message));
  addEventListener("click", (event) => {
    const button = /** @type {HTMLElement} */ (event.target).closest("button");
    if (button?.dataset.command) obey(button.dataset.command);
  });

  // -- recording

  /** The recording as steer-env evaluate reads it. */
  steerDriven.csv = () => {
    const manoeuvre = find("manoeuvre").value, [{ of, values }] = cars;
    const radius = structures.get(`${of.law} ${of.chassis}`).parameters
      .find((/** @type {Field} */ q) => q.name === "steering.pinion_radius").value;
    const ratio = (recording.meta.steering_ratio * radius) / values["steering.pinion_radius"];
    const flat = cars.every((car) => !structures.get(`${car.of.law} ${car.of.chassis}`).drive.inputs.includes("target_speed"));
    return log.text({
      ...(manoeuvre ? { manoeuvre } : {}), ...recording.meta, steering_ratio: ratio, chassis: of.chassis, friction: of.law,
      page: `steer-env explore ${declared.version}`, speed_m_s: values[declared.speed.name] / 3.6,
      device: told.device, motor: false, ...(acted.size ? { policies: [...acted] } : {}),
      sets: cars.map((car) => ({ label: car.label, car: recording.meta.vehicle, law: car.of.law, chassis: car.of.chassis,
        address: address.written(car.of).toString() })),
    }, flat);
  };
  find("manoeuvre").append(new Option("not named", ""));
  for (const name of recording.manoeuvres) find("manoeuvre").append(new Option(name, name));

  // -- blind test

  const staircases = steerStaircase(drive.blind);
  /** @type {any} */
  let blind = null;

  /** @returns {Field} */
  const differing = () => structures.get(`${cars[0].of.law} ${cars[0].of.chassis}`).parameters
    .find((/** @type {Field} */ q) => q.name === find("differs").value);

  async function beginTest() {
    if (find("policy").value) {
      tell("What you notice is tested without a policy: choose none first.");
      return;
    }
    find("policy").disabled = true;
    const field = differing(), value = cars[0].values[field.name];
    const upward = field.high - value >= value - field.low;
    blind = { field, value, room: upward ? field.high - value : field.low - value, stairs: new staircases.Staircase(), x: 0, y: 0 };
    find("differs").disabled = true;
    find("test").textContent = "End the test";
    for (const button of document.querySelectorAll("[data-command^=more]")) /** @type {any} */ (button).disabled = false;
    await trial();
  }

  async function trial() {
    const { field, value, room, stairs } = blind, number = stairs.answers.length + 1, swapped = Math.random() < 0.5;
    const { of } = cars[0], other = { ...of, values: { ...of.values, [field.name]: value + room * stairs.level } };
    [blind.x, blind.y] = [cars.length, cars.length + 1];
    blind.xHasMore = swapped === room > 0;
    const remarks = [];
    for (const [letter, one] of /** @type {[string, CarShown][]} */ ([["X", swapped ? other : of], ["Y", swapped ? of : other]])) {
      remarks.push(...await add(`${letter} of trial ${number}`, one));
    }
    if (remarks.length) throw new Error(remarks.join(" "));
    choose(blind.x);
    find("trial").textContent = `Trial ${number}: drive X and Y by their keys, and say which has more: ${field.label}.`;
  }

  /** @param {boolean} x whether the person says that X has more */
  async function answer(x) {
    blind.stairs.answer(x === blind.xHasMore);
    if (blind.stairs.over()) await endTest();
    else await trial();
  }

  async function endTest() {
    const { field, room, stairs } = blind, size = Math.abs(room), many = stairs.answers.length;
    const { low, middle, high } = stairs.threshold();
    const shown = (/** @type {number} */ part) => Number((part * size).toPrecision(2));
    const unit = field.unit === "1" ? "" : ` ${field.unit}`;
    const device = told.device, share = Math.round(100 * drive.blind.confidence);
    const found = high > 1 ? `at least ${shown(low)}${unit}, perhaps more than this page's slider has`
      : `${shown(middle)}${unit}, from ${shown(low)} to ${shown(high)}${unit} with ${share} %`;
    find("trial").textContent = many === 0 ? "The test was ended without an answer." :
      `Your threshold of ${field.label}, ${room > 0 ? "more" : "less"} than ${Number(blind.value.toPrecision(4))}${unit}, told in ` +
      `three of four trials: ${found}. This is a personal result of ${many} trial${many > 1 ? "s" : ""}, steered by ` +
      `${device}${device === "wheel" ? " without torque" : ", without torque in the hands"}; it says nothing about other drivers.`;
    steerDriven.threshold = many ? { low: low * size, middle: middle * size, high: high * size, trials: many } : null;
    blind = null;
    find("policy").disabled = false;
    find("differs").disabled = false;
    find("test").textContent = "Begin the test";
    for (const button of document.querySelectorAll("[data-command^=more]")) /** @type {any} */ (button).disabled = true;
    choose(0);
  }

  // -- picture

  const scene = steerScene(find("scene"), drive, view.style);
  function showView() {
    if (scene === null && !fromAbove) {
      fromAbove = true;
      status.textContent = `${status.textContent} The driver's view needs WebGL 2, which this browser lacks: the drive is ` +
        "shown from above.";
    }
    find("scene").hidden = fromAbove;
    find("seen").textContent = fromAbove ? "Driver's view" : "View from above";
  }

  /** @param {string} name @param {Float64Array} of */
  const channel = (name, of) => of[logging.place(name)];
  /** @param {Float64Array} of */
  const pose = (of) => ({ x: channel("x", of), y: channel("y", of), yaw: channel("yaw_angle", of) });

  /** The sample of a time of the clock, of the newest ones [ms]. @param {number} at */
  function sampleAt(at) {
    if (!newest) return null;
    const { samples, end } = newest, many = samples.length / logging.width;
    const back = Math.min(Math.max(Math.round((end - at) / (1e3 * drive.sampleTime)), 0), many - 1);
    return samples.subarray((many - 1 - back) * logging.width, (many - back) * logging.width);
  }

  /** @param {{x: number, y: number, yaw: number}} of */
  function onRoad({ x, y, yaw }) {
    const dx = x - origin.x, dy = y - origin.y, c = Math.cos(origin.yaw), s = Math.sin(origin.yaw);
    return { x: c * dx + s * dy, y: c * dy - s * dx, yaw: yaw - origin.yaw };
  }

  let toldPace = 0;
  function frame() {
    requestAnimationFrame(frame);
    readPad();
    const clock = performance.now(), sample = sampleAt(performance.timeOrigin + clock - pace.period);
    if (clock > noted) {
      find("notice").textContent = "";
      noted = Infinity;
    }
    const at = onRoad(sample ? pose(sample) : { x: 0, y: 0, yaw: 0 }), cones = passed(at.x, at.y, at.yaw);
    const of = (/** @type {string} */ name) => (sample ? channel(name, sample) : 0);
    const speed = log.speed();
    const now = {
      ...at, time: log.samples * drive.sampleTime, roll: of("roll_angle"), angle: of("handwheel_angle"),
      torque: of("torsion_bar_torque"), left: of("road_wheel_angle_left"), right: of("road_wheel_angle_right"),
      speed: Number.isFinite(speed) ? speed : held, held, acceleration: of("lateral_acceleration"),
      wanted: newest?.wanted ?? 0, hold: newest?.hold ?? true,
      hands: !hold ? "hands off" : newest?.hold === false ? "the policy drives" : "",
    };
    steerDriven.now = now;
    if (fromAbove || scene === null) {
      const x = 1 + logging.place("x"), y = 1 + logging.place("y"), yaw = 1 + logging.place("yaw_angle");
      const trace = log.rows.slice(-2000).filter((_, k) => k % 4 === 0)
        .map((row) => onRoad({ x: row[x], y: row[y], yaw: row[yaw] }));
      view.above(find("picture"), now, trace, cones);
    } else {
      scene(now, cones);
      view.clear(find("picture"));
      view.inside(find("picture"));
      view.instruments(find("picture"), now, false);
    }
    if (clock - toldPace > 500) {
      toldPace = clock;
      find("pace").textContent = `Simulated time at most ${steerDriven.largest.toFixed(1)} ms behind the clock so far; ` +
        "no sample skipped.";
      find("recorded").textContent = `${(log.rows.length * recording.samples * drive.sampleTime).toFixed(0)} s are recorded.`;
    }
  }

  // -- begin

  for (const { shown, says } of STEER_KEYS.filter((each) => each.shown)) {
    const pair = document.createElement("div");
    for (const [tag, textContent] of [["dt", shown], ["dd", says]]) {
      pair.append(Object.assign(document.createElement(tag), { textContent }));
    }
    find("keys").append(pair);
  }
  for (const name of Object.keys(drive.road.courses)) find("course").append(new Option(spaced(name.replaceAll("-", " ")), name));
  find("course").addEventListener("change", () => {
    passed = steerCourse(drive, find("course").value);
    tellRoad();
  });
  find("lead").textContent = `Drive ${declared.car.name}, simulated, in real time.`;
  find("back").href = `index.html${location.hash}`;
  addEventListener("hashchange", () => location.reload());  // a link to this page was opened in it
  await guarded((async () => {
    const start = address.read(location.hash.slice(1));
    const remarks = [...start.remarks, ...await add("This car", start.shown)];
    for (const name of address.PINS.filter((each) => each in start.pins)) {
      const read = address.read(start.pins[name], start.shown);
      remarks.push(...read.remarks, ...await add(`Pin ${name}`, read.shown));
    }
    own = cars.length;
    held = cars[0].values[declared.speed.name] / 3.6;
    for (const field of structures.get(`${cars[0].of.law} ${cars[0].of.chassis}`).parameters) {
      if (field.name !== declared.speed.name) find("differs").append(new Option(field.label, field.name));
    }
    find("differs").value = "friction_scale";
    worker.postMessage({ begin: { index: 0, speed: held } });
    if (remarks.length) status.textContent = `${status.textContent} ${remarks.join(" ")}`.trim();
    list();
    steerBy("keyboard");
    main.hidden = false;
    showView();
    stand("begin");
    board.focus();
    frame();
    steerDriven.ready = true;
  })());
}

Object.assign(globalThis, { steerDeclared: steerDrive });
