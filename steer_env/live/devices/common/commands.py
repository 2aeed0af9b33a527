"""What a person can press on every device, and the keys and buttons for it."""

import threading
from typing import Any

COMMANDS = {
    "swap": "exchange the configurations A and B",
    **{f"set_{i}": f"choose configuration {i}" for i in range(1, 10)},
    "faster": "raise the speed",
    "slower": "lower the speed",
    "recentre": "take the present angle as straight ahead",
    "road": "let the road begin anew under the car",
    "pause": "end the torque, or let it begin again",
    "quit": "end the drive",
}
DEAD_MAN = "dead_man"  # is held, not pressed
# Keys as pygame calls them, pygame.K_...
KEY_COMMANDS = {
    "TAB": "swap",
    **{str(i): f"set_{i}" for i in range(1, 10)},
    "PAGEUP": "faster",
    "PAGEDOWN": "slower",
    "c": "recentre",
    "r": "road",
    "p": "pause",
    "ESCAPE": "quit",
    "SPACE": DEAD_MAN,
}
BUTTONS = "swap=0+pause=1+recentre=2+dead_man=3+faster=4+slower=5"  # default of gamepads and wheels; assumed


def parse_buttons(text: str) -> dict[int, str]:
    """Commands by the number of the button, of a text as ``BUTTONS``.

    Raises
    ------
    ValueError
        The text is none, or names something else than ``COMMANDS`` and ``DEAD_MAN``.
    """
    found = {}
    for part in filter(None, text.split("+")):
        name, _, number = part.strip().partition("=")
        if (name not in COMMANDS and name != DEAD_MAN) or not number.isdecimal():
            known = ", ".join([*COMMANDS, DEAD_MAN])
            raise ValueError(f"buttons are like {BUTTONS!r}, got {part!r}; the commands are {known}")
        found[int(number)] = name
    return found


class Pressed:
    """What was pressed since somebody asked, and whether the dead-man key is held; for two threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._commands: set[str] = set()
        self._held: set[Any] = set()  # keys and buttons that are the dead-man key

    def down(self, key: Any, command: str) -> None:
        """A key or button of a command was pressed."""
        with self._lock:
            if command == DEAD_MAN:
                self._held.add(key)
            else:
                self._commands.add(command)

    def up(self, key: Any) -> None:
        """A key or button was released."""
        with self._lock:
            self._held.discard(key)

    def release(self) -> None:
        """All keys count as released, as where the window loses the keyboard."""
        with self._lock:
            self._held.clear()

    def dead_man(self, window: bool) -> bool:
        """Whether the dead-man key is held; ``window`` says whether that of a keyboard counts."""
        with self._lock:
            return any(window or not isinstance(key, int) for key in self._held)

    def pressed(self) -> frozenset[str]:
        """Commands pressed since the last call."""
        if not self._commands:
            return frozenset()
        with self._lock:
            found = frozenset(self._commands)
            self._commands.clear()
        return found


class Keys(Pressed):
    """The keyboard's part of it, by the events of pygame."""

    def __init__(self) -> None:
        super().__init__()
        self._commands_of: dict[int, str] = {}

    def feed(self, event: Any) -> None:
        """Take an event of any kind."""
        import pygame  # here, because it is an extra; who has an event has imported it

        if not self._commands_of:
            self._commands_of = {getattr(pygame, f"K_{key}"): command for key, command in KEY_COMMANDS.items()}
        if event.type == pygame.KEYDOWN and event.key in self._commands_of:
            self.down(event.key, self._commands_of[event.key])
        elif event.type == pygame.KEYUP:
            self.up(event.key)
        elif event.type == pygame.WINDOWFOCUSLOST:
            self.release()
