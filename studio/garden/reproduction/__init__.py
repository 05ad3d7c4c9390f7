"""The papers' figures, tables and claims run again: the catalogue of experiments, their runner and their report.

What an experiment is called, its source and its claim are in one table (`experiments.toml`), the order of the report;
a module lists under that name its settings (trials) and what they show, which `Experiment.conclude` sorts and judges.
A trial's outcome is kept under a name made of its measure (`kept_as`) and arguments: code may move, names not.
`Experiment.trials → plan → TrialJob → an executor → KeptTrials → Experiment.conclude → Findings → document → report`.
`--into-guide` keeps a thinned document with the commits that measured it in `web_assets/guide/reproduction`.
`verdicts_by_hand` reaches five of the verdicts from these documents again, sharing nothing with what judges.
"""
