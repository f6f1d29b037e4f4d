"""Proximal policy optimization: a policy that answers a condition with a design, learned by stable-baselines3."""
