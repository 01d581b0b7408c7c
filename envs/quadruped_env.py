"""The step loop: a batch of Go1 robots that walk on command, as an rsl_rl `VecEnv`.

This module orders things: set points, physics, contacts, reward, ends of episodes, resets,
observations. What a reward or an observation is stands in its own module; learning is elsewhere.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import torch
from rsl_rl.env import VecEnv
from tensordict import TensorDict

from .base_state import base_state
from .commands import CommandSampler
from .curriculum import Curriculum, curriculum
from .engines import make_simulation
from .extra_sensors import ExtraSensors
from .following import FollowedVelocity
from .footfall import Footfalls
from .initial_state import NUM_DRAWS, place
from .observations import (
    noise_amplitude,
    policy_observation,
    privileged_observation,
    privileged_widths,
    slices,
)
from .quadruped_env_cfg import QuadrupedEnvCfg
from .randomization import randomize_physics
from .rewards import Motion, RewardSum
from .scene import FOOT_RADIUS, LEGS, STAND_JOINT_POS, SceneCfg, build_scene
from .sensors import RobotSensors
from .step_log import curriculum_log, episode_log, gait_log, ground_log
from .terrain import QUIET_KINDS, BoxGround, FlatGround, Ground, kind_of_robot, num_boxes
from .terrain.commands import AHEAD_DRAWS, suit_commands
from .terrain.draws import KEYS
from .terrain.levels import Travelled, next_levels
from .terrain.slope import slope_under

__all__ = ["NUM_ACTIONS", "QuadrupedEnv"]

NUM_ACTIONS = 12


class QuadrupedEnv(VecEnv):
    """A batch of Go1 robots on the ground.

    One step: set points, `decimation` physics steps, contacts and phase, reward, ends, resets,
    observations. Foot positions and velocities come from sensors and lag the joints by one physics
    step (MuJoCo's own order); contacts and foot velocities lag alike, so a landing is consistent.

    Observation groups: `policy` (o_t, noised; shape (num_envs, 46)) and `privileged` (true
    velocity, heights, contacts, causal phases, physics; see `privileged_slices`). Every step
    returns new tensors: rsl_rl keeps references.

    Everything lives on the engine's device. A GPU is waited for only where the program takes a
    branch on what the robots did (a byte or a count: unstable, finished, due for a command or a
    push, and what is logged of landings); nothing else leaves it.
    """

    def __init__(self, cfg: QuadrupedEnvCfg, device: str = "cpu") -> None:
        """Compile the scene, draw the physics of every robot and reset all.

        Args:
            cfg: The task.
            device: Device of the engine; with `mujoco`, which has the CPU alone, everything stays
                there.

        Raises:
            ValueError: If the configuration is out of range, or the engine cannot be had.
        """
        self.cfg: QuadrupedEnvCfg = cfg  # pyright: ignore[reportIncompatibleVariableOverride]
        self.num_envs = cfg.num_envs
        self.num_actions = NUM_ACTIONS
        self.autoreset = True
        """Whether `step` resets finished robots; without, it returns what they saw last, and the
        caller resets them with `reset`."""
        self.physics_listeners: list[Callable[[], None]] = []
        """Called in turn after the physics of every control step, of which the engine's `substeps`
        then tell. Whoever listens appends itself, and removes itself in the end."""
        self.step_dt = cfg.step_dt
        self.max_episode_length = math.ceil(cfg.episode_length / cfg.step_dt)
        self.model = build_scene(scene_of(cfg), pictured=False)
        self._stand_key = self.model.key("stand").id
        self.simulation = make_simulation(
            self.model, cfg.num_envs, device, cfg.num_threads, cfg.engine
        )
        self.device = self.simulation.device
        self.generator = torch.Generator(self.device).manual_seed(cfg.seed)
        drawn = randomize_physics(self.simulation, cfg.randomization, self.generator)
        self.physics = drawn.known
        """Randomised physics as the critic sees it. Shape: (num_envs, PHYSICS_DIM)."""
        self.encoder_offset, self.imu = drawn.encoder_offset, drawn.imu
        self._sensors = RobotSensors(self.simulation)
        self._extra_sensors = None
        if cfg.observations.sensors:
            self._extra_sensors = ExtraSensors(self.simulation, self._sensors, cfg.step_dt)
        self.grid = cfg.height_map.grid(self.device)
        """Points of the height map in the heading frame, m. Shape: (num_heights, 2)."""
        self.ground = self._make_ground()
        """The ground under the robots."""
        self._command_steps = self._steps_of_commands()
        self._quiet_share = self._quiet_share_of_robots()
        self.travelled = Travelled(cfg.num_envs, self.device)
        if isinstance(self.ground, BoxGround):
            self.travelled.across = self.ground.across
        self.commands = CommandSampler(cfg.commands, cfg.num_envs, self.generator, self.device)
        self.footfalls = Footfalls(
            cfg.footfall, cfg.num_envs, cfg.scene.timestep, cfg.decimation, self.device
        )
        self.followed = FollowedVelocity(cfg.rewards, cfg.step_dt, cfg.num_envs, self.device)
        self.reward_sum = RewardSum(cfg.rewards, cfg.step_dt, cfg.num_envs, self.device)
        self.stand = torch.tensor(STAND_JOINT_POS, device=self.device)
        """Joint positions of the stance, rad. Shape: (12,)."""
        self.privileged_slices = slices(privileged_widths(len(self.grid)))
        """Columns of each part of the group `privileged`."""
        self._noise = noise_amplitude(cfg.observations, self.device)
        self._allocate()
        self._reset(self._everyone())
        self._observe()

    # -- VecEnv ---------------------------------------------------------------------------------

    def get_observations(self) -> TensorDict:
        """Return the observations of the last step or reset, without side effects."""
        return self._observations

    def step(
        self, actions: torch.Tensor
    ) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """Advance every robot by one control step; with `autoreset`, finished ones begin anew.

        Args:
            actions: Joint offsets over `action_scale`, for all of the step, shape (num_envs, 12),
                or for each of its physics steps, shape (num_envs, decimation, 12); the last of
                these is then the action that is rewarded and observed.

        Returns:
            Observations after resets, rewards (num_envs,), dones (num_envs,), and `extras` with
            `time_outs` (num_envs,), where an episode was cut off by its time or by an unstable
            simulation, and `log`.
        """
        phase = self._phase()
        self._take_action(actions)
        self._advance()
        self.step_count += 1
        self.episode_length_buf += 1
        self._read_state()
        self.travelled.update(
            self.base_pos[:, :2], self.commands.command, self.base_lin_vel, self.step_dt
        )
        self.fallen = self._falls()
        factors = self.curriculum
        motion = self._motion(phase)
        quiet = factors.quiet * self._quiet_share
        reward, shares = self.reward_sum(motion, quiet, factors.lift, factors.guide)
        # What an unstable simulation did is neither the policy's merit nor its fault: it gains
        # nothing in this step, and is worth from then on what its last observation promised.
        reward = torch.where(self.unstable, 0.0, reward)
        over = self.episode_length_buf >= self.max_episode_length
        time_outs = (over | self.unstable) & ~self.fallen
        dones = self.fallen | time_outs
        log = self._log(shares, factors, dones)
        if self.autoreset and bool(dones.any()):
            self._reset(dones)
        self._resample_and_push(dones)
        self._observe()
        return self._observations, reward, dones, {"time_outs": time_outs, "log": log}

    # -- what others may set or read -------------------------------------------------------------

    @property
    def foot_pos(self) -> torch.Tensor:
        """Centre of each foot in the world, m. Shape: (num_envs, 4, 3)."""
        return self._sensors.foot_pos

    @property
    def curriculum(self) -> Curriculum:
        """Factors that change with the time trained so far."""
        return curriculum(self.cfg, self.step_count)

    def set_estimated_phase(self, phase: torch.Tensor) -> None:
        """Hand over the phase estimated from o_t, before the step that it shapes the reward of.

        Args:
            phase: Estimated phase of each foot, in [0, 1]. Shape: (num_envs, 4).
        """
        self._estimated_phase = phase

    def set_command(self, command: torch.Tensor) -> None:
        """Replace the commands of all robots, and what they observe of them, at once.

        Args:
            command: (v_x, v_y, w_z, beta). Shape: (num_envs, 4) or (4,).
        """
        self.commands.command[:] = command
        self._observe()

    def reset(self, mask: torch.Tensor | None = None) -> TensorDict:
        """Begin a new episode and return the observations of all robots.

        Args:
            mask: Robots that begin anew; None for all. Shape: (num_envs,), bool.
        """
        self._reset(self._everyone() if mask is None else mask)
        self._observe()
        return self._observations

    def state_dict(self) -> dict[str, Any]:
        """Return all that is needed to continue bit for bit."""
        state: dict[str, Any] = {name: getattr(self, name).clone() for name in _STATE_TENSORS}
        state["step_count"] = self.step_count
        state["unstable_count"] = self.unstable_count
        state["command"] = self.commands.command.clone()
        state["generator"] = self.generator.get_state()
        state["simulation"] = self.simulation.state_dict()
        state["footfalls"] = self.footfalls.state_dict()
        state["followed"] = self.followed.state_dict()
        state["travelled"] = self.travelled.state_dict()
        if isinstance(self.ground, BoxGround):
            state["ground"] = self.ground.state_dict()
        if self._extra_sensors is not None:
            state["extra_sensors"] = self._extra_sensors.state_dict()
        state["encoder_offset"] = self.encoder_offset.clone()
        state["imu"] = None if self.imu is None else self.imu.clone()
        state["observations"] = {key: value.clone() for key, value in self._observations.items()}
        return state

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from a `state_dict`.

        Raises:
            ValueError: If it belongs to another number of robots or another model.
        """
        self.simulation.load_state_dict(state["simulation"])
        for name in _STATE_TENSORS:
            setattr(self, name, state[name].to(self.device, copy=True))
        if self._extra_sensors is not None:
            self._extra_sensors.load_state_dict(state["extra_sensors"])
        self.step_count = state["step_count"]
        self.unstable_count = state["unstable_count"]
        self.commands.command.copy_(state["command"])
        self.generator.set_state(state["generator"])
        self.footfalls.load_state_dict(state["footfalls"])
        self.followed.load_state_dict(state["followed"])
        if "travelled" in state:  # earlier versions have none of these
            self.travelled.load_state_dict(state["travelled"])
            self.encoder_offset = state["encoder_offset"].to(self.device, copy=True)
            imu = state["imu"]
            self.imu = None if imu is None else imu.to(self.device, copy=True)
        if isinstance(self.ground, BoxGround):
            self.ground.load_state_dict(state["ground"])
        self._read_state()
        groups = {k: value.to(self.device, copy=True) for k, value in state["observations"].items()}
        self._observations = TensorDict(groups, batch_size=[self.num_envs])

    # -- one step, in order ----------------------------------------------------------------------

    def _phase(self) -> torch.Tensor:
        """Return the phases that the coming step is rewarded by, of o_t. Shape: (num_envs, 4)."""
        if self.cfg.rewards.phase_source == "estimated":
            return self._estimated_phase
        return self.footfalls.phase

    def _take_action(self, actions: torch.Tensor) -> None:
        clip = self.cfg.action_clip
        self.action_before_last, self.last_action = self.last_action, self.action
        self.invalid_action = ~actions.isfinite().flatten(1).all(dim=1)
        # NaN would pass a clamp and reach the engine.
        self._actions = torch.nan_to_num(actions).clamp(-clip, clip)
        self.action = self._actions if actions.dim() == 2 else self._actions[:, -1]

    def _advance(self) -> None:
        """Run the physics of one control step and record the feet at every physics step."""
        simulation = self.simulation
        # Motors hold what their encoders read, which is the joint's position and the offset.
        exact = self.stand - self.encoder_offset
        torch.add(exact, self.action, alpha=self.cfg.action_scale, out=simulation.ctrl)
        if isinstance(self.ground, BoxGround):
            self.ground.lay(simulation.qpos[:, :2])
        if self._extra_sensors is not None:
            self._extra_sensors.begin()
        ctrl = None
        if self._actions.dim() == 3:
            ctrl = exact[:, None] + self.cfg.action_scale * self._actions
        simulation.step(self.cfg.decimation, ctrl)
        for listener in self.physics_listeners:
            listener()
        sensors = self._sensors
        self.footfalls.record(sensors.foot_vel_z_substeps, sensors.foot_contact_substeps)
        if self._extra_sensors is not None:
            self._extra_sensors.end()
        self.unstable = simulation.unstable()
        if bool(self.unstable.any()):
            # Reset before anything is read, so that no NaN reaches a reward or an average.
            self.unstable_count += int(self.unstable.sum())
            simulation.reset(self.unstable, keyframe=self._stand_key)
            simulation.forward(self.unstable)
            self.footfalls.reset(self.unstable, self._sensors.foot_contact)

    def _read_state(self) -> None:
        """Derive what rewards and observations share from the engine's state."""
        base = base_state(self.simulation.qpos, self.simulation.qvel)
        self.base_pos, self.base_lin_vel, self.base_ang_vel = base.pos, base.lin_vel, base.ang_vel
        self.projected_gravity, self.heading = base.projected_gravity, base.heading
        self.joint_pos = self.simulation.qpos[:, 7:] - self.stand
        self.joint_vel = self.simulation.qvel[:, 6:]

    def _motion(self, phase: torch.Tensor) -> Motion:
        feet = self.footfalls
        foot_pos = self._sensors.foot_pos
        ground = self.ground.below(foot_pos[:, :, :2], self.base_pos[:, :2])
        bottom = foot_pos[:, :, 2] - FOOT_RADIUS
        feet.update(bottom, ground.near_feet)
        load = self._sensors.foot_load
        joint_acc = (self.joint_vel - self.last_joint_vel) / self.step_dt
        self.last_joint_vel = self.joint_vel.clone()
        torque = self.simulation.actuator_force
        self.power = (torque * self.joint_vel).abs().sum(dim=1)
        return Motion(
            command=self.commands.command,
            base_lin_vel=self.base_lin_vel,
            base_ang_vel=self.base_ang_vel,
            velocity_error=self.followed.update(
                self.commands.command, self.base_lin_vel, self.base_ang_vel
            ),
            yaw_drift=self.followed.drift,
            projected_gravity=self.projected_gravity,
            base_height=self.base_pos[:, 2] - ground.trunk,
            joint_pos=self.joint_pos,
            joint_vel=self.joint_vel,
            joint_acc=joint_acc,
            torque=torque,
            action=self.action,
            last_action=self.last_action,
            action_before_last=self.action_before_last,
            collisions=(self._sensors.shape_contact > 0.0).sum(dim=1).float(),
            phase=phase,
            foot_drop_sq=feet.drop_sq,
            foot_raise_sq=feet.raise_sq,
            foot_vel_z_substeps=feet.vel_z,
            foot_load=None if load is None else load.masked_fill(self.unstable[:, None], 0.0),
            foot_speed_xy=self._sensors.foot_vel[:, :, :2].norm(dim=2),
            foot_height=bottom - ground.feet,
            foot_lift=bottom - ground.near_feet,
            contact=feet.contact,
            touchdown=feet.touchdown,
            landing_speed=feet.landing_speed,
            stride_time=feet.stride_time,
            swing_apex=feet.swing_apex,
            ground_slope=slope_under(foot_pos[:, :, :2], ground.feet, self.heading),
            fallen=self.fallen,
        )

    def _falls(self) -> torch.Tensor:
        """Return which robots fell; those of unstable simulations stand again already."""
        upright = -self.projected_gravity[:, 2]
        down = (self._sensors.trunk_contact > 0.0).any(dim=1)
        return (down | (upright < math.cos(self.cfg.max_tilt))) & ~self.unstable

    def _reset(self, mask: torch.Tensor) -> None:
        """Begin new episodes for the masked robots; no other robot is touched."""
        self.simulation.reset(mask, keyframe=self._stand_key)
        draw = self._draw(self.num_envs, NUM_DRAWS)
        heading = self.ground.heading(draw[:, NUM_DRAWS - 1])
        place(self.simulation, mask, draw, heading, self.stand, self.cfg)
        self._renew_ground(mask)
        self._lift_to_ground(mask)
        self._command(mask, True)
        self.footfalls.reset(mask, self._sensors.foot_contact)
        self.followed.reset(mask)
        self.travelled.reset(mask, self.simulation.qpos[:, :2].float())
        for name in _PAST:
            setattr(self, name, getattr(self, name).masked_fill(mask.unsqueeze(1), 0.0))
        self.episode_length_buf = self.episode_length_buf.masked_fill(mask, 0)
        if self._extra_sensors is not None:
            self._extra_sensors.reset(mask)
        self._read_state()

    def _lift_to_ground(self, mask: torch.Tensor) -> None:
        """Put the lowest foot of each masked robot on the ground: joint noise would bury it."""
        self.simulation.forward(mask, "positions")
        robots = torch.nonzero(mask)[:, 0]
        feet = self._sensors.foot_pos[robots]
        ground = self.ground.height_below(feet[:, :, :2], FOOT_RADIUS, robots)
        lowest = (feet[:, :, 2] - FOOT_RADIUS - ground).amin(dim=1)
        self.simulation.qpos[robots, 2] -= lowest
        self.simulation.forward(mask)

    def _renew_ground(self, mask: torch.Tensor) -> None:
        """Lay other ground for the masked robots, of a level that follows what they could do."""
        ground, cfg = self.ground, self.cfg.terrain
        if not isinstance(ground, BoxGround):
            return
        unit = torch.rand(2, self.num_envs, generator=self.generator, device=self.device)
        if cfg.curriculum and self.step_count:
            levels = next_levels(
                ground.level, self.travelled, self.fallen, cfg.crossed, cfg.passed_share, unit[0]
            )
            ground.level = torch.where(mask, levels, ground.level)
        ground.key = torch.where(mask, (unit[1] * KEYS).long(), ground.key)
        ground.lay(self.simulation.qpos[:, :2], mask)

    def _command(self, mask: torch.Tensor, with_beta: bool) -> None:
        """Draw new commands for the masked robots, with beta where an episode begins."""
        self.commands.resample(mask, with_beta, self.curriculum.commands)
        ground, cfg = self.ground, self.cfg.terrain
        if isinstance(ground, BoxGround) and (cfg.turning_share < 1.0 or cfg.ahead_share > 0.0):
            velocity = self.commands.command[:, :3]
            # What draws nothing changes no other draw.
            draw = torch.ones(self.num_envs, AHEAD_DRAWS, device=self.device)
            if cfg.ahead_share > 0.0:
                draw.uniform_(generator=self.generator)
            fastest = self.commands.largest(self.curriculum.commands)
            velocity.copy_(suit_commands(velocity, mask & ground.across, cfg, fastest, draw))

    def _resample_and_push(self, dones: torch.Tensor) -> None:
        due = self._due(self._command_steps) & ~dones
        if bool(due.any()):
            self._command(due, False)
        cfg = self.cfg.randomization
        if not (cfg.enabled and cfg.push_interval > 0.0):
            return
        due = self._due(self._steps(cfg.push_interval))
        if bool(due.any()):
            push = self._draw(self.num_envs, 2) * (cfg.push_velocity * due.unsqueeze(1))
            self.simulation.qvel[:, :2] += push
            self._read_state()  # the critic and the estimator's label know of the push

    def _due(self, steps: int | torch.Tensor) -> torch.Tensor:
        """Return in whose episode so many steps end with this one. Shape: (num_envs,), bool."""
        return (self.episode_length_buf % steps == 0) & (self.episode_length_buf > 0)

    def _steps(self, interval: float) -> int:
        """Return an interval, s, in control steps: one at least."""
        return max(1, round(interval / self.step_dt))

    def _observe(self) -> None:
        policy = policy_observation(
            self.cfg.observations.scales,
            self._by_imu(self.base_ang_vel),
            self._by_imu(self.projected_gravity),
            self.joint_pos + self.encoder_offset,
            self.joint_vel,
            self.action,
            self.commands.command,
        )
        if self.cfg.observations.noise_level > 0.0:
            policy += self._noise * self._draw(*policy.shape)
        heights = self.ground.height_map(self.grid, self.base_pos, self.heading)
        heights = self.cfg.height_map.normalised(heights)
        feet = self.footfalls
        privileged = privileged_observation(
            self.base_lin_vel, heights, feet.raw_contact, feet.phase, self.physics
        )
        groups = {"policy": policy, "privileged": privileged}
        if self._extra_sensors is not None:
            force, contact = self._extra_sensors.read()
            observed = self.cfg.observations
            noise = observed.noise_level * observed.accelerometer_noise
            force = self._by_imu(force) + noise * self._draw(self.num_envs, 3)
            groups["sensors"] = torch.cat((force, contact), dim=1)
        self._observations = TensorDict(groups, batch_size=[self.num_envs])

    def _by_imu(self, vectors: torch.Tensor) -> torch.Tensor:
        """Return vectors of the body frame as the inertial sensor has them. (num_envs, 3)."""
        return vectors if self.imu is None else (self.imu * vectors[:, None]).sum(dim=2)

    def _log(
        self, shares: dict[str, torch.Tensor], factors: Curriculum, dones: torch.Tensor
    ) -> dict[str, torch.Tensor]:
        return {
            **{f"Reward/{name}": share for name, share in shares.items()},
            **gait_log(self.commands.command, self.base_lin_vel, self.power, self.footfalls),
            **episode_log(dones, self.fallen, self.unstable, self.invalid_action),
            **curriculum_log(factors, self.device),
            **ground_log(self.ground),
        }

    def _draw(self, *shape: int) -> torch.Tensor:
        """Return random numbers in [-1, 1)."""
        return 2.0 * torch.rand(shape, generator=self.generator, device=self.device) - 1.0

    def _everyone(self) -> torch.Tensor:
        """Return a mask of all robots. Shape: (num_envs,)."""
        return torch.ones(self.num_envs, dtype=torch.bool, device=self.device)

    # -- set-up ----------------------------------------------------------------------------------

    def _make_ground(self) -> Ground:
        cfg = self.cfg.terrain
        if set(cfg.shares) == {"flat"}:
            return FlatGround()
        ground = BoxGround(self.simulation, kind_of_robot(cfg, self.num_envs))
        low, high = cfg.first_levels
        unit = torch.rand(self.num_envs, generator=self.generator, device=self.device)
        ground.level = low + (unit * (high - low + 1)).long()
        return ground

    def _steps_of_commands(self) -> torch.Tensor:
        """Return for how many steps each robot has the same command. Shape: (num_envs,)."""
        usual = self._steps(self.cfg.commands.resampling_time)
        time = torch.full((self.num_envs,), usual, device=self.device)
        longer, ground = self.cfg.terrain.command_time, self.ground
        if longer > 0.0 and isinstance(ground, BoxGround):
            has_levels = [name != "flat" for name in ground.kinds]
            with_levels = torch.tensor(has_levels, device=self.device)[ground.kind]
            time = torch.where(with_levels, self._steps(longer), time)
        return time

    def _quiet_share_of_robots(self) -> float | torch.Tensor:
        """Return what each robot's ground leaves of the phase rewards' weight."""
        share, ground = self.cfg.terrain.quiet_share, self.ground
        if share == 1.0 or not isinstance(ground, BoxGround):
            return 1.0
        level = [name in QUIET_KINDS for name in ground.kinds]
        on_level = torch.tensor(level, device=self.device)[ground.kind]
        return torch.where(on_level, 1.0, share)

    def _allocate(self) -> None:
        num_envs, device = self.num_envs, self.device
        zeros = torch.zeros(num_envs, NUM_ACTIONS, device=device)
        self.action = self.last_action = self.action_before_last = self.last_joint_vel = zeros
        self.episode_length_buf = torch.zeros(num_envs, dtype=torch.long, device=device)
        nobody = torch.zeros(num_envs, dtype=torch.bool, device=device)
        self.fallen = nobody
        """Robots that fell in the last step. Shape: (num_envs,), bool."""
        self.unstable = nobody
        """Robots whose simulation blew up in it, which is no fall. Shape: (num_envs,), bool."""
        self.invalid_action = nobody
        """Robots whose action in it held NaN, taken for 0, or infinity, taken for the clip.
        Shape: (num_envs,), bool."""
        self.power = torch.zeros(num_envs, device=device)
        self.step_count = 0
        self.unstable_count = 0
        self._estimated_phase = torch.zeros(num_envs, len(LEGS), device=device)


def scene_of(cfg: QuadrupedEnvCfg) -> SceneCfg:
    """Return a task's scene, with the boxes that its ground takes and the delays of its motors."""
    scene, robots = cfg.scene, cfg.randomization
    longest_delay = robots.hull("action_delay")[1] if robots.enabled else 0.0
    return dataclasses.replace(
        scene,
        ground_boxes=max(scene.ground_boxes, num_boxes(cfg.terrain.shares)),
        longest_delay=max(scene.longest_delay, longest_delay),
    )


_PAST = ("action", "last_action", "action_before_last", "last_joint_vel")
_STATE_TENSORS = (*_PAST, "episode_length_buf", "_estimated_phase", "physics")
