"""Trains an agent of Stable-Baselines3 to dock, and is the docking controller that drives as it has learned.

Run it: ``pip install "msrr-bullet[gym]" stable-baselines3``, then ``python examples/train_agent.py``.
"""

from pathlib import Path

import gymnasium
import numpy as np
import torch
from stable_baselines3 import SAC

import msrr_bullet.gym
from msrr_control.docking.controller import ControlInputs, DockSetup
from msrr_scenes.messages import Twist

#: One command lasts so many control instants: 0.1 s.
REPEAT = 5
#: What the numbers of an observation are divided by, so that each is about 1.
SCALE = np.array([0.3, 0.03, 0.2, 0.01, 0.01, 0.02, 0.3, 0.3, 1.0, 0.1, 0.3, 0.1], dtype=np.float32)
MODEL = Path("agent.zip")


def command(action: np.ndarray) -> np.ndarray:
    """Return (v, w) of two numbers between -1 and 1: always forward, or the agent learns to wait."""
    return np.array([0.12 + 0.08 * action[0], 0.5 * action[1]])


class Progress(gymnasium.Wrapper):
    """Adds gamma * potential(next) - potential(now); the potential is 1 in the seat, 0 far away."""

    gamma = 0.99

    def potential(self, info):
        pose = info["progress"].true
        if pose is None:
            return 0.0
        towards_axis = np.clip(-4.0 * pose.y, -0.3, 0.3)
        return np.exp(-abs(pose.x + 0.1) - 2.0 * abs(pose.y) - 0.3 * abs(pose.yaw - towards_axis))

    def reset(self, **kwargs):
        observation, info = self.env.reset(**kwargs)
        self.before = self.potential(info)
        return observation, info

    def step(self, action):
        observation, reward, terminated, truncated, info = self.env.step(action)
        after = 0.0 if terminated else self.potential(info)
        reward += self.gamma * after - self.before
        self.before = after
        return observation, reward, terminated, truncated, info


class Repeat(gymnasium.Wrapper):
    """Gives every command for several control instants."""

    def step(self, action):
        total, over, instants = 0.0, False, 0
        while not over and instants < REPEAT:
            observation, reward, terminated, truncated, info = self.env.step(action)
            total, over, instants = total + reward, terminated or truncated, instants + 1
        return observation, total, terminated, truncated, info


class Agent:
    """The docking controller that drives as an agent has learned."""

    def __init__(self, setup: DockSetup, model: str = str(MODEL)) -> None:
        torch.set_num_threads(1)
        self.model, self.instant = SAC.load(model, device="cpu"), 0

    def reset(self, inputs: ControlInputs) -> None:
        """Begin an approach."""
        self.instant = 0

    def step(self, inputs: ControlInputs) -> Twist:
        """Return the command for this instant."""
        if self.instant % REPEAT == 0:
            seen = msrr_bullet.gym.observation(inputs) / SCALE
            self.twist = Twist(*map(float, command(self.model.predict(seen, deterministic=True)[0])))
        self.instant += 1
        return self.twist


if __name__ == "__main__":
    torch.set_num_threads(1)
    quick = {"plant": "unicycle", "perception": "parametric", "docking.attempts": 1}
    env = Progress(Repeat(gymnasium.make("msrr_bullet/Docking-v0", overrides=quick)))
    env = gymnasium.wrappers.TransformAction(env, command, gymnasium.spaces.Box(-1.0, 1.0, (2,)))
    env = gymnasium.wrappers.TransformObservation(env, lambda seen: seen / SCALE, env.observation_space)
    agent = SAC(
        "MlpPolicy",
        env,
        learning_rate=1e-3,
        learning_starts=500,
        gradient_steps=2,
        ent_coef="auto_0.02",
        policy_kwargs={"net_arch": [64, 64]},
        seed=0,
        verbose=1,
    )
    agent.learn(12_000)
    agent.save(MODEL)
