"""How loud a robot walks: a simulated microphone, and a sound level meter for any recording.

On the way from the physics to a level:

- `audible_env` makes the configurations of environments that can be heard;
- `recorder` copies the physics of every step, no sound yet, as blocks of `contacts`;
- `soundscape` makes the pressure at a `microphone` of them, from `sources` on `floors`, by the laws
  in `physics`, of the robot's `body` and the `air`, and `room_sound` adds what walls give back;
  `energy` makes levels of them at once, without sound;
- `listener` has all of these for any number of robots, writes their sound, and keeps their figures
  in a `tally`; `live_listener` is one for the first robot of a walk that is watched.

`metering` measures levels, of robots and of real recordings alike, and `files` holds WAV files.
Which sounds and films of a walk are kept is `mute.rendering.kept_walks`'.
"""
