"""How a task is learnt: the agent's configuration, and configurations to and from plain data."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Literal

import cattrs

from mute.config_versions import upgraded
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.networks.estimator import EstimatorCfg
from mute.support.ranges import Range, check_ordered, check_ranges

__all__ = ["AgentCfg", "EstimationCfg", "PPOCfg", "TaskCfg", "from_plain", "to_plain"]

_POSITIVE = Range(0.0, above=True)
_WEIGHT = Range(0.0)
_SHARE = Range(0.0, 1.0)
_COUNT = Range(1, 10**9, whole=True)
_PASSES = Range(1, 1000, whole=True)
_WIDTH = Range(1, 16384, whole=True)
"""A layer of that width has a gigabyte of weights already."""


@dataclass
class EstimationCfg:
    """Training of the estimator (paper, section II-B)."""

    network: EstimatorCfg = field(default_factory=EstimatorCfg)
    """Sizes of the estimator."""
    learning_rate: float = 1.0e-3
    """Learning rate of the estimator's own Adam."""
    lambda_fwd: float = 1.0
    """Weight of the forward model's loss."""
    lambda_phase: float = 1.0
    """Weight of the phase loss."""
    lambda_kl: float = 1.0e-3
    """Weight of the KL divergence inside the forward model's loss."""
    robots_share: float = 1.0
    """Share of the robots that an update learns from, drawn anew for each."""
    num_mini_batches: int = 4
    """Parts that those robots are split into; each makes one step of the optimiser."""
    max_grad_norm: float = 1.0
    """Bound on the gradient's norm."""
    actor_uses_phase: bool = True
    """Whether the group `estimate` holds the phase; False is the paper's exact actor."""
    adaptive_bootstrap: bool = False
    """Whether actor and critic see the true velocity in place of the estimate for some robots, the
    fewer the more alike the returns of all are (DreamWaQ's); by default they see estimates."""

    def __post_init__(self) -> None:
        """Check the fields.

        Raises:
            ValueError: If one is out of its range.
        """
        ranges = {
            "learning_rate": _POSITIVE,
            "lambda_fwd": _WEIGHT,
            "lambda_phase": _WEIGHT,
            "lambda_kl": _WEIGHT,
            "robots_share": Range(0.0, 1.0, above=True),
            "num_mini_batches": _COUNT,
            "max_grad_norm": _POSITIVE,
        }
        check_ranges(self, "agent.estimation", ranges)

    def robots_learnt_from(self, num_envs: int) -> int:
        """Return how many of a number of robots an update learns from."""
        # The product may fall short of a whole number by a rounding: 0.29 * 100.
        return max(1, int(self.robots_share * num_envs + 1.0e-6))


@dataclass
class PPOCfg:
    """Settings of rsl_rl's PPO; the field's for the Go1, and the paper's Adam at 1e-3."""

    num_learning_epochs: int = 5
    """Passes over a rollout."""
    num_mini_batches: int = 4
    """Parts of a rollout, all of one size: rsl_rl leaves out the samples that are over, fewer than
    there are parts."""
    clip_param: float = 0.2
    """Clipping range of the probability ratio and of the value."""
    gamma: float = 0.99
    """Discount."""
    lam: float = 0.95
    """Lambda of the generalised advantage estimate."""
    value_loss_coef: float = 1.0
    """Weight of the value loss."""
    entropy_coef: float = 0.01
    """Weight of the entropy bonus."""
    learning_rate: float = 1.0e-3
    """Adam's learning rate, at the start where the schedule adapts it."""
    schedule: Literal["adaptive", "fixed"] = "adaptive"
    """Whether the learning rate follows the KL divergence."""
    desired_kl: float = 0.01
    """KL divergence that the adaptive schedule aims at."""
    max_grad_norm: float = 1.0
    """Bound on the gradients' norms."""
    use_clipped_value_loss: bool = True
    """Whether the value loss is clipped."""

    def __post_init__(self) -> None:
        """Check the fields.

        Raises:
            ValueError: If one is out of its range.
        """
        ranges = {
            "num_learning_epochs": _PASSES,
            "num_mini_batches": _COUNT,
            "clip_param": _POSITIVE,
            "gamma": _SHARE,
            "lam": _SHARE,
            "value_loss_coef": _WEIGHT,
            "entropy_coef": _WEIGHT,
            "learning_rate": _POSITIVE,
            "desired_kl": _POSITIVE,
            "max_grad_norm": _POSITIVE,
        }
        check_ranges(self, "agent.ppo", ranges)


@dataclass
class AgentCfg:
    """Networks, PPO and estimator, and how long they learn."""

    iterations: int = 800
    """Number of rollouts and updates."""
    num_steps_per_env: int = 24
    """Control steps of a rollout."""
    settling_share: float = 0.0
    """Share of the iterations, the last ones, over which all learning rates fall to zero in a
    straight line: without, the velocity at which a policy walks shifts from one to the next."""
    late_entropy_share: float = 1.0
    """What is left of the entropy bonus, `ppo.entropy_coef`, after `entropy_iterations`, as a
    share."""
    entropy_iterations: tuple[int, int] = (0, 0)
    """Iterations in which it falls to that share, in a straight line: the first and the last,
    counted from the training's beginning. (0, 0) where it does not fall."""
    save_interval: int = 50
    """Iterations between checkpoints."""
    noise_interval: int = 20
    """Iterations between short trials that measure the modelled noise level; 0 for none."""
    actor_hidden: tuple[int, ...] = (256, 128, 64)
    """Widths of the actor's hidden layers."""
    critic_hidden: tuple[int, ...] = (256, 128, 64)
    """Widths of the critic's hidden layers."""
    activation: Literal["elu", "relu", "selu", "tanh"] = "elu"
    """Activation of actor and critic."""
    symmetric: bool = False
    """Whether the networks treat left and right alike, see `mute.networks.reflection`."""
    leading_side: bool = False
    """Whether symmetric networks may begin a step with one side, always the same: a robot that
    stands level and still is its own mirror image, and no trot is."""
    quiet_factor: bool = True
    """Whether the networks see beta; DreamWaQ's observation has none."""
    go_signal: bool = False
    """Whether actor and critic see, beside the command, whether it is one to move: a step is taken
    whole or not at all, at 0.1 m/s as at 1, and a network that sees 0.1 as next to nothing
    stands."""
    heading_gain: float = 0.0
    """Yaw rate that the trained policy is asked for against each radian that the robot has turned
    by while it was to go straight, 1/s, see `mute.controllers.heading_hold`; 0 for none. Robots
    in training have none."""
    init_std: float = 1.0
    """Standard deviation of the actions at the start."""
    std_range: tuple[float, float] = (0.05, 1.2)
    """Bounds on it; unbounded, the entropy bonus can blow it up."""
    matmul_precision: Literal["highest", "high", "medium"] = "medium"
    """torch's float32 matrix products in a training: 'medium' lets processors that have bfloat16
    units use them, those with tiles (AMX) for all products, those with AVX-512 units for hidden
    layers and the LSTM."""
    ppo: PPOCfg = field(default_factory=PPOCfg)
    """The algorithm."""
    estimation: EstimationCfg = field(default_factory=EstimationCfg)
    """The estimator."""

    def __post_init__(self) -> None:
        """Check the fields.

        Raises:
            ValueError: If one is out of its range.
        """
        ranges = {
            "iterations": _COUNT,
            "num_steps_per_env": Range(1, 10000, whole=True),
            "settling_share": _SHARE,
            "late_entropy_share": _SHARE,
            "entropy_iterations": Range(0, 10**9, whole=True),
            "save_interval": _COUNT,
            "noise_interval": Range(0, 10**9, whole=True),
            "actor_hidden": _WIDTH,
            "critic_hidden": _WIDTH,
            "heading_gain": Range(0.0, 100.0),
            "init_std": _POSITIVE,
            "std_range": _POSITIVE,
        }
        check_ranges(self, "agent", ranges)
        for name in ("actor_hidden", "critic_hidden"):
            if not getattr(self, name):
                raise ValueError(f"agent.{name} must be one width at least, got ()")
        if self.symmetric:
            self._check_even_widths()
        elif self.leading_side:
            raise ValueError("agent.leading_side must be false unless agent.symmetric, got true")
        check_ordered(self, "agent", "entropy_iterations", "std_range")
        if (self.late_entropy_share < 1.0) != (self.entropy_iterations[1] > 0):
            raise ValueError(
                "agent.entropy_iterations and agent.late_entropy_share go together, got "
                f"{self.entropy_iterations} and {self.late_entropy_share:g}"
            )

    def _check_even_widths(self) -> None:
        network = self.estimation.network
        widths = {
            "actor_hidden": self.actor_hidden,
            "critic_hidden": self.critic_hidden,
            "estimation.network.lstm_hidden": (network.lstm_hidden,),
            "estimation.network.latent_dim": (network.latent_dim,),
            "estimation.network.history_hidden": network.history_hidden,
            "estimation.network.decoder_hidden": network.decoder_hidden,
            "estimation.network.phase_hidden": network.phase_hidden,
        }
        for name, values in widths.items():
            odd = [width for width in values if width % 2]
            if odd:
                raise ValueError(f"agent.{name} must be even for agent.symmetric, got {odd[0]}")

    def rsl_rl(self) -> dict[str, Any]:
        """Return the configuration that rsl_rl's runner takes."""
        network = {
            "class_name": "mute.learning.model:PreparedModel",
            "activation": self.activation,
            "obs_normalization": True,
        }
        distribution = {
            "class_name": "mute.learning.distribution:SharedGaussian",
            "init_std": self.init_std,
            "std_range": self.std_range,
        }
        seen = ["policy", "estimate", *(["go"] if self.go_signal else [])]
        return {
            "num_steps_per_env": self.num_steps_per_env,
            "check_for_nan": False,  # see `EstimatorPPO.process_env_step`
            "save_interval": self.save_interval,
            "obs_groups": {
                "actor": seen,
                "critic": [*seen, "privileged"],
            },
            "actor": network | {"hidden_dims": self.actor_hidden, "distribution_cfg": distribution},
            "critic": network | {"hidden_dims": self.critic_hidden},
            "algorithm": {"class_name": "mute.learning.algorithm:EstimatorPPO"} | asdict(self.ppo),
            "logger": {"class_name": "mute.learning.logger:CurveWriter"},
        }


@dataclass
class TaskCfg:
    """A task: its environment and the agent that learns it."""

    env: QuadrupedEnvCfg = field(default_factory=QuadrupedEnvCfg)
    """The robot and its world."""
    agent: AgentCfg = field(default_factory=AgentCfg)
    """Learning."""

    def __post_init__(self) -> None:
        """Check what neither part can know alone.

        Raises:
            ValueError: If mini-batches would be empty, nobody estimates the phase that is rewarded
                by, left and right cannot be treated alike, or a heading is to be held unseen.
        """
        num_envs, agent, scales = self.env.num_envs, self.agent, self.env.observations.scales
        if agent.heading_gain > 0.0 and not (
            scales["base_ang_vel"] and scales["projected_gravity"]
        ):
            raise ValueError(
                "agent.heading_gain must be 0 where env.observations.scales have 0 for "
                f"base_ang_vel or projected_gravity, got {agent.heading_gain:g}"
            )
        samples = num_envs * agent.num_steps_per_env
        if agent.ppo.num_mini_batches > samples:
            raise ValueError(
                "agent.ppo.num_mini_batches must be <= env.num_envs * agent.num_steps_per_env = "
                f"{samples}, got {agent.ppo.num_mini_batches}"
            )
        robots = agent.estimation.robots_learnt_from(num_envs)
        if agent.estimation.num_mini_batches > robots:
            raise ValueError(
                "agent.estimation.num_mini_batches must be <= the number of robots learnt from, "
                f"env.num_envs * agent.estimation.robots_share or {robots}, "
                f"got {agent.estimation.num_mini_batches}"
            )
        if not agent.estimation.network.phase and self.env.rewards.phase_source == "estimated":
            raise ValueError(
                "env.rewards.phase_source must be 'true' without agent.estimation.network.phase, "
                "got 'estimated'"
            )
        low, high = self.env.randomization.com_offset
        if agent.symmetric and low != -high:
            raise ValueError(
                "env.randomization.com_offset must be (-x, x) for agent.symmetric, "
                f"got {(low, high)}"
            )


def to_plain(cfg: TaskCfg) -> dict[str, Any]:
    """Return a configuration as dictionaries, lists, strings and numbers."""
    return _listed(asdict(cfg))


def from_plain(data: dict[str, Any] | None) -> TaskCfg:
    """Make a configuration from what `to_plain` returned, in this version or an earlier one.

    Raises:
        ValueError: If a field is missing where it must not be, unknown, or out of its range.
    """
    if not isinstance(data, dict):
        raise ValueError(f"configuration must be a dictionary, got {type(data).__name__}")
    try:
        return _converter.structure(upgraded(data), TaskCfg)
    except cattrs.BaseValidationError as error:
        reasons = "; ".join(cattrs.transform_error(error, format_exception=_reason))
        raise ValueError(f"configuration does not fit this version: {reasons}") from error


def _exactly(value: Any, expected: type) -> Any:  # noqa: ANN401
    """Refuse what `int` and `bool` would turn into another value: 2.7, or "False"."""
    if type(value) is not expected:
        raise ValueError(f"expected {expected.__name__}, got {value!r}")
    return value


_converter = cattrs.Converter(forbid_extra_keys=True)
_converter.register_structure_hook(int, _exactly)
_converter.register_structure_hook(bool, _exactly)


def _reason(error: BaseException, expected: type | None) -> str:
    """Return what cattrs says, but a field's own check in the words of the check."""
    if isinstance(error, ValueError) and expected in (None, int, bool):
        return str(error)
    return cattrs.v.format_exception(error, expected)


def _listed(value: Any) -> Any:  # noqa: ANN401
    if isinstance(value, dict):
        return {key: _listed(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_listed(item) for item in value]
    return value
