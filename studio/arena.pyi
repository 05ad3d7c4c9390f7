# What editors and type checkers know of `studio.arena`, whose names are imported on first use.

from studio.operations.arena import export as export
from studio.operations.arena import problems as problems
from studio.operations.arena import problems_of as problems_of
from studio.operations.arena import race as race
from studio.operations.arena import racers as racers
from studio.results.arena.problem import ArenaError as ArenaError
from studio.results.arena.problem import BudgetSpentError as BudgetSpentError
from studio.results.arena.problem import KnownBest as KnownBest
from studio.results.arena.problem import Prior as Prior
from studio.results.arena.problem import Problem as Problem
from studio.results.arena.racers import Racer as Racer
