"""The case file: what a user asks for, read from YAML into one typed, checked, frozen model.

Attribute names are the keys of the file. All quantities are in SI units. Whatever is wrong with a
file is told as one :class:`CaseError` that lists every problem found, each on a line of its own
that begins with the path of the key, for example ``particles.packing.domain_radius``.
"""

from __future__ import annotations

import difflib
import io
import itertools
import math
import reprlib
import unicodedata
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    PrivateAttr,
    Tag,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    field_validator,
    model_validator,
)
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import (
    AliasEvent,
    CollectionEndEvent,
    CollectionStartEvent,
    Event,
    NodeEvent,
)

from lammps_blast.input_files import regular_files_only
from lammps_blast.interactions import softened_stiffness

MAX_FILE_BYTES = 2**16
# What a case file may hold of collections and scalars, of collections inside each other, and of
# aliases, whose number bounds how far they can multiply what they stand for.
MAX_NODES, MAX_DEPTH, MAX_ALIASES = 2000, 20, 20
MAX_PROBLEMS = 50
# LAMMPS counts the steps of one `run` in a 32-bit integer.
MAX_STEPS = 2**31 - 1
# A duration is a whole number of steps when it misses one by less than this part of itself.
WHOLE_STEPS_TOLERANCE = 1e-6

# Of near fields summed by tree: root mean square of the error over that of the force.
DEFAULT_ACCURACY = 1e-6

# How far from the number wanted a default interval is looked for that divides the duration.
DIVISORS_TRIED = 10_000
# With `integrator: implicit` LAMMPS's own steps hold at most so many of the longest ones: it looks
# for interruptions, and tells how far it is, only between them.
MOST_STEPS_WITHIN = 100

# No quantity in SI units is beyond these; past them products leave the range of doubles.
SMALLEST_SIZE, LARGEST_SIZE = 1e-100, 1e100


class CaseError(ValueError):
    """A case that cannot be run as it stands.

    Attributes
    ----------
    problems : tuple of str
        One line each; ``str()`` of the error is all of them, one per line.
    """

    def __init__(self, *problems: str) -> None:
        super().__init__(*problems)
        self.problems = problems

    def __str__(self) -> str:
        return "\n".join(self.problems)


def shown(value: object) -> str:
    """Return a value as the user may have written it, on one line and not longer than a line."""
    if value is None:
        return "nothing (null)"
    if isinstance(value, bool):
        return str(value).lower()
    brief = reprlib.Repr()
    brief.maxlevel, brief.maxstring, brief.maxlong, brief.maxother = 2, 60, 40, 60
    try:
        text = brief.repr(value)
    except ValueError:  # Python refuses to write out integers of more than 4300 digits
        return "an enormous integer"
    return text if len(text) <= 80 else f"{text[:77]}..."


def shown_path(path: Path) -> str:
    """Return a path in full, quoted and escaped where it would not stay on one line."""
    text = str(path)
    return text if text.isprintable() else repr(text)


# The path of a key, from the section that a validator sits at, and what is wrong there.
_Problem = tuple[tuple[str, ...], str]


class _InconsistentError(ValueError):
    """Problems of values that are fine one by one.

    The key paths start below the place where the validator that raises this sits.
    """

    def __init__(self, *problems: _Problem) -> None:
        super().__init__("; ".join(text for _, text in problems))
        self.problems = problems


def _as_vector(value: object) -> object:
    """Let a YAML list of three stand for a vector; its components are checked as numbers later."""
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise ValueError("must be a list of three numbers [x, y, z]")
    return tuple(value)


def is_of_sane_size(value: float) -> bool:
    """Tell whether a number is zero or one whose square and cube a double can hold."""
    return value == 0.0 or SMALLEST_SIZE <= abs(value) <= LARGEST_SIZE


def _of_sane_size(value: float) -> float:
    if not is_of_sane_size(value):
        raise ValueError(f"must be zero or between {SMALLEST_SIZE:g} and {LARGEST_SIZE:g} in size")
    return value


def _without_control_characters(value: str) -> str:
    if any(unicodedata.category(character) in {"Cc", "Cs", "Zl", "Zp"} for character in value):
        raise ValueError("must be one line of text without control characters")
    return value


def _is_absent(key: str, info: ValidationInfo) -> bool:
    """Tell whether a key was left out; a key of an invalid value was not."""
    return key in info.data and info.data[key] is None


Quantity = Annotated[float, AfterValidator(_of_sane_size)]
Positive = Annotated[Quantity, Field(gt=0)]
NonNegative = Annotated[Quantity, Field(ge=0)]
Vector = Annotated[tuple[Quantity, Quantity, Quantity], BeforeValidator(_as_vector)]
ZERO_VECTOR = (0.0, 0.0, 0.0)


class _Section(BaseModel):
    model_config = ConfigDict(
        frozen=True, strict=True, extra="forbid", allow_inf_nan=False, hide_input_in_errors=True
    )


class Packing(_Section):
    """How equal spheres are placed inside a spherical domain of radius `domain_radius` (m).

    With `relax` they may overlap at first, and the deck pushes them apart before the pulse.
    """

    method: Literal["rsa"] = "rsa"
    domain_radius: Positive = Field(description="a length in m")
    relax: bool = False


class PackedParticles(_Section):
    """Equal spheres at rest, placed by a packing method.

    `radius` in m, `density` in kg/m3, `charge_per_mass` in C/kg. A part `positive_fraction` of the
    particles carries `charge_per_mass`, the rest its opposite.
    """

    count: int = Field(ge=1, lt=2**31, description="a number of particles")
    radius: Positive = Field(description="a length in m")
    density: Positive = Field(description="a density in kg/m3")
    charge_per_mass: Quantity = Field(description="a number in C/kg")
    positive_fraction: float = Field(ge=0, le=1, default=1.0)
    packing: Packing = Field(description="a section with at least `domain_radius`")

    @property
    def positive_count(self) -> int:
        """Number of particles that carry `charge_per_mass`; the rest carries its opposite."""
        return round(self.positive_fraction * self.count)

    @field_validator("packing")
    @classmethod
    def _one_particle_fits(cls, packing: Packing, info: ValidationInfo) -> Packing:
        radius = info.data.get("radius")
        if radius is not None and radius > packing.domain_radius:
            text = f"must be at least the particle radius {radius!r}, got {packing.domain_radius!r}"
            raise _InconsistentError((("domain_radius",), text))
        return packing


class ParticlesFromFile(_Section):
    """Particles read from a CSV file; a relative path starts at the folder of the case file."""

    file: str = Field(min_length=1, description="the path of a CSV file")
    allow_overlap: bool = False

    _check_file = field_validator("file")(_without_control_characters)

    @model_validator(mode="before")
    @classmethod
    def _not_packed_as_well(cls, section: Any) -> Any:
        packed = [key for key in PackedParticles.model_fields if key in section]
        if packed:
            raise ValueError(
                "either packed or read from a file, not both; "
                f"remove `file` or remove `{'`, `'.join(packed)}`"
            )
        return section


class Blast(_Section):
    """The pulse that starts the motion; `energy` in J (W in eq. 3.4)."""

    energy: Positive = Field(description="an energy in J")


class Fields(_Section):
    """Uniform external fields (eq. 2.1); `electric` in V/m, `magnetic` in T."""

    electric: Vector = ZERO_VECTOR
    magnetic: Vector = ZERO_VECTOR


class Medium(_Section):
    """The surrounding medium and its drag law (sections 3.1 and 4).

    `density` in kg/m3, `viscosity` in Pa s, `velocity` in m/s; `drag_coefficient` (C_D in eq. 3.6)
    goes with `drag: constant` only.
    """

    drag: Literal["none", "constant", "chow", "stokes"] = "none"
    density: NonNegative = Field(default=0.0, validate_default=True)
    viscosity: NonNegative = Field(default=0.0, validate_default=True)
    velocity: Vector = ZERO_VECTOR
    drag_coefficient: Positive | None = Field(default=None, validate_default=True)

    @field_validator("density", "viscosity")
    @classmethod
    def _enough_for_the_law(cls, value: float, info: ValidationInfo) -> float:
        needed_by = {"density": {"constant", "chow"}, "viscosity": {"chow", "stokes"}}
        drag = info.data.get("drag")
        if value == 0 and drag in needed_by[str(info.field_name)]:
            raise ValueError(f"must be greater than 0 with `drag: {drag}`")
        return value

    @field_validator("drag_coefficient")
    @classmethod
    def _constant_law_only(cls, value: float | None, info: ValidationInfo) -> float | None:
        drag = info.data.get("drag")
        if drag == "constant" and value is None:
            raise ValueError("must be a number greater than 0 with `drag: constant`")
        if drag not in {"constant", None} and value is not None:
            raise ValueError(f"goes with `drag: constant` only, not with `drag: {drag}`")
        return value


class Friction(_Section):
    """Coulomb friction at a contact (eq. 7.11 to 7.15), with coefficients `static` and `dynamic`.

    `stiffness` is in N/m3 with `law: zohdi` and in N/m with `law: hooke`; the other contact laws
    take it from the material.
    """

    stiffness: Positive | None = None
    static: NonNegative = Field(description="a coefficient of friction")
    dynamic: NonNegative = Field(description="a coefficient of friction, at most `static`")

    @field_validator("dynamic")
    @classmethod
    def _at_most_the_static(cls, dynamic: float, info: ValidationInfo) -> float:
        static = info.data.get("static")
        if static is not None and dynamic > static:
            raise ValueError(f"must be at most the static coefficient {static!r}")
        return dynamic


class Thermal(_Section):
    """Softening of the contact stiffness with temperature (eq. 7.18 to 7.20).

    `temperature` and `reference` in K, `floor`, the least stiffness, in N/m2.
    """

    temperature: Positive = Field(description="a temperature in K")
    reference: Positive = Field(description="a temperature in K")
    sensitivity: NonNegative = Field(description="a number")
    floor: Positive = Field(description="a stiffness in N/m2")

    @property
    def softening(self) -> tuple[float, float, float, float]:
        """Temperature, reference, sensitivity and floor, as the laws want them."""
        return self.temperature, self.reference, self.sensitivity, self.floor


_STOCK_LAWS = ("hooke", "hertz", "jkr", "dmt")
_MATERIAL_LAWS = ("hertz", "jkr", "dmt")
# The keys of `contact` that go with some laws only; all but `thermal` are required there.
_LAWS_OF_KEY = {
    "stiffness": ("zohdi", "hooke"),
    "exponent": ("zohdi",),
    "thermal": ("zohdi",),
    "youngs_modulus": _MATERIAL_LAWS,
    "poisson_ratio": _MATERIAL_LAWS,
    "surface_energy": ("jkr", "dmt"),
}


class Contact(_Section):
    """The forces between particles that touch (section 7).

    `law: zohdi` is that of the paper: `stiffness` (K in eq. 7.5) in N/m2, `damping` (c in eq. 7.10)
    in N s/m3. The other laws are those of LAMMPS's `pair_style granular`, with `damping` in N s/m:
    `hooke` has a `stiffness` in N/m, the others have `youngs_modulus` in Pa and `poisson_ratio`,
    `jkr` and `dmt` also `surface_energy` in J/m2. What does not go with the law is None.
    """

    law: Literal["zohdi", "hooke", "hertz", "jkr", "dmt"] = "zohdi"
    stiffness: Positive | None = Field(
        default=None,
        validate_default=True,
        description="a stiffness greater than 0, in N/m2 (`zohdi`) or N/m (`hooke`),",
    )
    exponent: NonNegative | None = Field(
        default=None, validate_default=True, description="an exponent of at least 0"
    )
    damping: NonNegative = 0.0
    friction: Friction | None = None
    thermal: Thermal | None = None
    rotation: bool = Field(default=False, validate_default=True)
    youngs_modulus: Positive | None = Field(
        default=None, validate_default=True, description="a modulus greater than 0 in Pa"
    )
    poisson_ratio: Annotated[Quantity, Field(gt=-1, le=0.5)] | None = Field(
        default=None, validate_default=True, description="a number above -1 and at most 0.5"
    )
    surface_energy: Positive | None = Field(
        default=None, validate_default=True, description="an energy greater than 0 in J/m2"
    )

    @property
    def is_stock(self) -> bool:
        """Whether LAMMPS's own `pair_style granular` computes the forces."""
        return self.law in _STOCK_LAWS

    @property
    def has_memory(self) -> bool:
        """Whether LAMMPS's own law keeps what has been in a contact, and cannot try steps."""
        return self.is_stock and (self.friction is not None or self.law == "jkr")

    @field_validator(*_LAWS_OF_KEY)
    @classmethod
    def _goes_with_the_law(cls, value: Any, info: ValidationInfo) -> Any:
        law, key = info.data.get("law"), str(info.field_name)
        if law is None:
            return value
        if law not in _LAWS_OF_KEY[key] and value is not None:
            raise ValueError(_goes_with_others(law, _LAWS_OF_KEY[key]))
        if law in _LAWS_OF_KEY[key] and value is None and key != "thermal":
            raise ValueError(f"must be {cls.model_fields[key].description} with `law: {law}`")
        return value

    @field_validator("thermal")
    @classmethod
    def _softened_stiffness_is_a_number(
        cls, thermal: Thermal | None, info: ValidationInfo
    ) -> Thermal | None:
        stiffness = info.data.get("stiffness")
        if thermal is None or stiffness is None:
            return thermal
        with np.errstate(over="ignore"):
            softened = softened_stiffness(stiffness, *thermal.softening)
        if not is_of_sane_size(float(softened)):
            text = f"makes a stiffness of {softened:.3g} N/m2, got {thermal.sensitivity!r}"
            raise _InconsistentError((("sensitivity",), text))
        return thermal

    @field_validator("friction")
    @classmethod
    def _friction_of_the_law(
        cls, friction: Friction | None, info: ValidationInfo
    ) -> Friction | None:
        law = info.data.get("law")
        problems = list(_friction_problems(friction, law)) if friction and law else []
        if problems:
            raise _InconsistentError(*problems)
        return friction

    @field_validator("rotation")
    @classmethod
    def _stock_friction_turns_particles(cls, rotation: bool, info: ValidationInfo) -> bool:
        law = info.data.get("law")
        if law in _STOCK_LAWS and info.data.get("friction") and not rotation:
            raise ValueError(
                f"must be true with `friction` and `law: {law}`, whose friction turns particles"
            )
        return rotation


def _friction_problems(friction: Friction, law: str) -> Iterator[_Problem]:
    """Yield what of a friction does not go with a contact law."""
    stiffness, got = friction.stiffness, f"got {shown(friction.stiffness)}"
    if law in _MATERIAL_LAWS and stiffness is not None:
        yield ("stiffness",), f"{_goes_with_others(law, _LAWS_OF_KEY['stiffness'])}, {got}"
    if law not in _MATERIAL_LAWS and stiffness is None:
        yield ("stiffness",), f"must be a stiffness greater than 0 with `law: {law}`, {got}"
    if law in _STOCK_LAWS and friction.dynamic != friction.static:
        text = f"must equal the static coefficient {friction.static!r} with `law: {law}`, which"
        yield ("dynamic",), f"{text} has one coefficient, got {friction.dynamic!r}"


def _goes_with_others(law: str, laws: tuple[str, ...]) -> str:
    return f"goes with {' or '.join(f'`law: {name}`' for name in laws)} only, not with `law: {law}`"


class Bond(_Section):
    """Bonds between particles in contact (eq. 7.16 and 7.17).

    `stiffness` in N/m2, `tangential_stiffness` in N/m3. A bond is active once the strain of the
    contact reaches `activation_strain`: until the two part (`memory: contact`), or while the strain
    is that large (`memory: none`).
    """

    stiffness: NonNegative = Field(description="a stiffness in N/m2")
    exponent: NonNegative = Field(description="an exponent of at least 0")
    tangential_stiffness: NonNegative = 0.0
    activation_strain: float = Field(
        gt=0,
        lt=1,
        description="a strain between 0 and 1: the paper gives no value for it, so a case must",
    )
    memory: Literal["contact", "none"] = "contact"


class PowerLaw(_Section):
    """One term of the near field, strength × distance^-exponent (eq. 7.23)."""

    strength: NonNegative = Field(description="a number of at least 0")
    exponent: NonNegative = Field(description="an exponent of at least 0")

    def outgrows(self, other: PowerLaw | None) -> bool:
        """Tell whether this term less the other is unbounded as the distance goes to zero."""
        if self.strength == 0 or self.exponent == 0:
            return False
        if other is None or other.strength == 0:
            return True
        return (self.exponent, self.strength) > (other.exponent, other.strength)


def _length_or_all(value: object, check: ValidatorFunctionWrapHandler) -> float | str:
    try:
        return check(value)
    except ValidationError:
        raise ValueError("must be a length greater than 0 in m, or the word `all`") from None


class NearField(_Section):
    """Attraction and repulsion between particles at a distance (eq. 7.23).

    `scaling` says what of the two particles multiplies the strengths. Pairs farther apart than
    `cutoff` (m) feel nothing; with `all` every pair counts. Over the last `switch_width` (m) before
    the cutoff the force goes smoothly to zero. All pairs are summed by `method`: directly, or by a
    tree whose force deviates by the part `accuracy`, in the root mean square over the particles.
    """

    scaling: Literal["mass", "area", "volume", "charge"] = Field(
        description="'mass', 'area', 'volume' or 'charge'"
    )
    attraction: PowerLaw | None = None
    repulsion: PowerLaw | None = Field(default=None, validate_default=True)
    cutoff: Annotated[Positive | Literal["all"], WrapValidator(_length_or_all)] = Field(
        description="a length in m, or the word `all`"
    )
    switch_width: Positive | None = None
    method: Literal["auto", "direct", "tree"] | None = Field(
        default=None, validate_default=True, description="'auto', 'direct' or 'tree'"
    )
    accuracy: float | None = Field(gt=0, lt=1, default=None, validate_default=True)

    @field_validator("repulsion")
    @classmethod
    def _one_of_the_two(cls, repulsion: PowerLaw | None, info: ValidationInfo) -> PowerLaw | None:
        if repulsion is None and _is_absent("attraction", info):
            raise ValueError(
                "must be a section of `strength` and `exponent` where there is no `attraction`"
            )
        return repulsion

    @field_validator("switch_width")
    @classmethod
    def _within_the_cutoff(cls, width: float | None, info: ValidationInfo) -> float | None:
        cutoff = info.data.get("cutoff")
        if width is None or cutoff is None:
            return width
        if cutoff == "all":
            raise ValueError("goes with a `cutoff` in m only, not with `cutoff: all`")
        if width >= cutoff:
            raise ValueError(f"must be less than the cutoff {cutoff!r}")
        return width

    @field_validator("method")
    @classmethod
    def _of_all_pairs(cls, method: str | None, info: ValidationInfo) -> str | None:
        cutoff = info.data.get("cutoff")
        if cutoff == "all":
            return method or "auto"
        if method is not None and cutoff is not None:
            raise ValueError("goes with `cutoff: all` only")
        return method

    @field_validator("accuracy")
    @classmethod
    def _of_approximate_sums(cls, accuracy: float | None, info: ValidationInfo) -> float | None:
        method = info.data.get("method")
        if accuracy is None:
            return DEFAULT_ACCURACY if method in ("auto", "tree") else None
        if "method" in info.data and info.data.get("cutoff") is not None:
            if method is None:
                raise ValueError("goes with `cutoff: all` only")
            if method == "direct":
                raise ValueError("goes with `method` tree or auto: a direct sum is exact")
        return accuracy

    def divergence(self, positive: int, negative: int) -> _Problem | None:
        """Return a problem if some pair attracts without bound as it meets, None if none does.

        Attraction and repulsion change roles between particles of unlike sign.

        Parameters
        ----------
        positive, negative
            Numbers of particles of either sign.

        Returns
        -------
        tuple of tuple of str and str, or None
            The key below `near_field`, and what is wrong with it.
        """
        like, unlike = max(positive, negative) > 1, min(positive, negative) > 0
        ending = "without bound when they meet, and nothing holds them apart; add `contact`"
        if like and self.attraction and self.attraction.outgrows(self.repulsion):
            text = f"diverges: particles attract each other {ending}"
            remedy = "" if unlike else ", or a repulsion with a higher exponent"
            return ("attraction", "exponent"), f"{text}{remedy}, got {self.attraction.exponent!r}"
        if unlike and self.repulsion and self.repulsion.outgrows(self.attraction):
            text = f"diverges: it attracts particles of unlike sign {ending}"
            remedy = "" if like else ", or an attraction with a higher exponent"
            return ("repulsion", "exponent"), f"{text}{remedy}, got {self.repulsion.exponent!r}"
        return None


class Implicit(_Section):
    """The adaptive scheme of `integrator: implicit` (section 8, appendix C).

    A step takes the part `phi` of the forces at its end; these are found by at most `iterations`
    corrections, until the last one is smaller than the part `tolerance` of the step's motion. The
    step is `first_step` (s) at first, never longer than `max_step` (s), and changes by `safety`
    times eq. C.5. Two accelerations: `solve_fields` solves for magnetic force and drag in closed
    form, `anderson` is the number of earlier corrections that the next one is mixed with.
    """

    phi: float = Field(ge=0, le=1, default=0.5)
    iterations: int = Field(ge=1, le=1000, default=10)
    tolerance: float = Field(gt=0, lt=1, default=5.0e-4)
    max_step: Positive | None = None
    first_step: Positive | None = Field(default=None, validate_default=True)
    safety: float = Field(gt=0, le=1, default=1.0)
    solve_fields: bool = False
    anderson: int = Field(ge=0, le=5, default=0)

    @field_validator("first_step")
    @classmethod
    def _at_most_the_largest(cls, first: float | None, info: ValidationInfo) -> float | None:
        largest = info.data.get("max_step")
        if first is not None and largest is not None and first > largest:
            raise ValueError(f"must be at most max_step, {largest!r}")
        return first

    def resolved(self, step: float, duration: float) -> Implicit:
        """Return the section with its steps as numbers: where none is given, `step` (s)."""
        longest = self.max_step or step
        first = self.first_step or longest
        if first > longest:
            text = f"must be at most `time.step`, the max_step, {longest!r}, got {first!r}"
            raise _InconsistentError((("first_step",), text))
        if duration / longest > MAX_STEPS:
            least = duration / MAX_STEPS
            text = f"must be at least {least:.3g}, for at most {MAX_STEPS} steps, got {longest!r}"
            raise _InconsistentError((("max_step",), text))
        return self.model_copy(update={"max_step": longest, "first_step": first})


class Time(_Section):
    """Simulated time `duration` (s), time step `step` (s) and the scheme that takes the steps.

    With `integrator: implicit` the length of steps is up to the section `implicit`; `duration` and
    the intervals of output are whole numbers of `step` all the same.
    """

    duration: Positive = Field(description="a length of time in s")
    step: Positive = Field(description="a length of time in s")
    integrator: Literal["lorentz", "verlet", "implicit"] = "lorentz"
    implicit: Implicit | None = Field(default=None, validate_default=True)

    @property
    def steps(self) -> int:
        """Number of times that `step` goes into the duration."""
        return round(self.duration / self.step)

    @property
    def longest_step(self) -> float:
        """Length in s of the longest step that may be taken."""
        if self.integrator != "implicit":
            return self.step
        assert self.implicit is not None
        assert self.implicit.max_step is not None  # resolved when `implicit` was checked
        return self.implicit.max_step

    @field_validator("implicit")
    @classmethod
    def _steps_of_the_scheme(
        cls, implicit: Implicit | None, info: ValidationInfo
    ) -> Implicit | None:
        step, duration = info.data.get("step"), info.data.get("duration")
        if info.data.get("integrator") == "implicit" and step and duration:
            return (implicit or Implicit()).resolved(step, duration)
        return implicit

    @field_validator("step")
    @classmethod
    def _divides_the_duration(cls, step: float, info: ValidationInfo) -> float:
        duration = info.data.get("duration")
        if duration is None:
            return step
        if step > duration:
            raise ValueError(f"must be at most the duration {duration!r}")
        if duration / step > MAX_STEPS:
            raise ValueError(
                f"must be at least {duration / MAX_STEPS:.3g}, for at most {MAX_STEPS} steps"
            )
        if _whole_steps(duration, step) is None:
            fitting = duration / round(duration / step)
            raise ValueError(
                f"must divide the duration {duration!r} into whole steps; the nearest step that "
                f"does is {fitting:.9g}"
            )
        return step


class Output(_Section):
    """What is written and how often.

    `forces` adds forces and torques to the trajectory, `contacts` a file with a row for every
    contact. `interval` (s) between frames and `restart_interval` (s) between restart files may be
    left out of the file; in a loaded case both are resolved to numbers, whole multiples of the time
    step.
    """

    interval: Positive | None = None
    forces: bool = False
    contacts: bool = False
    format: Literal["text", "binary"] = "text"
    restart_interval: Positive | None = None


def _kind_of_particles(section: object) -> str:
    from_file = isinstance(section, ParticlesFromFile) or (
        isinstance(section, dict) and "file" in section
    )
    return "file" if from_file else "packed"


AnyParticles = Annotated[
    Annotated[PackedParticles, Tag("packed")] | Annotated[ParticlesFromFile, Tag("file")],
    Discriminator(_kind_of_particles),
]


class Case(_Section):
    """One simulation, completely described.

    Made by :func:`load_case` or :func:`parse_case`. `fields`, `medium` and `output` have defaults;
    without `blast` there is no pulse, without `contact`, `bond` and `near_field` particles do not
    feel each other.
    """

    name: str = Field(
        pattern=r"\A[a-z0-9_-]{1,80}\z", description="1 to 80 of the characters a-z, 0-9, _ and -"
    )
    title: str = Field(max_length=200, default="")
    seed: int = Field(ge=0, lt=2**31, default=1)
    particles: AnyParticles = Field(description="a section that packs particles or names a file")
    blast: Blast | None = None
    fields: Fields = Fields()
    medium: Medium = Medium()
    contact: Contact | None = None
    bond: Bond | None = None
    near_field: NearField | None = None
    time: Time = Field(description="a section with at least `duration` and `step`")
    output: Output = Field(default=Output(), validate_default=True)

    _folder: Path = PrivateAttr(default=Path())

    _check_title = field_validator("title")(_without_control_characters)

    def model_post_init(self, context: Any) -> None:
        """Remember the folder that relative paths start from."""
        if context is not None:
            self._folder = context["folder"]

    @property
    def folder(self) -> Path:
        """Folder of the case file, where a relative `particles.file` starts."""
        return self._folder

    @property
    def interacts(self) -> bool:
        """Whether particles feel each other, by touch or at a distance."""
        return self.contact is not None or self.near_field is not None

    @property
    def timestep(self) -> float:
        """Length in s of a time step of LAMMPS.

        It is `time.step`. With `integrator: implicit`, which takes steps of its own within, it is
        the longest time of which the duration and the intervals of output are whole numbers, or a
        part of it that holds at most `MOST_STEPS_WITHIN` of the longest steps.
        """
        time, output = self.time, self.output
        assert output.interval is not None  # resolved when `output` was checked
        assert output.restart_interval is not None
        if time.integrator != "implicit":
            return time.step
        lengths = (time.duration, output.interval, min(output.restart_interval, time.duration))
        whole = math.gcd(*(round(length / time.step) for length in lengths))
        pieces = math.ceil(whole * time.step / (MOST_STEPS_WITHIN * time.longest_step) - 1e-9)
        return time.duration / (time.steps // whole * max(pieces, 1))

    @property
    def timesteps(self) -> int:
        """Number of time steps of LAMMPS in the run."""
        return round(self.time.duration / self.timestep)

    @property
    def output_every(self) -> int:
        """Number of LAMMPS's time steps from one frame to the next."""
        assert self.output.interval is not None
        return round(self.output.interval / self.timestep)

    @property
    def restart_every(self) -> int:
        """Number of LAMMPS's time steps from one restart file to the next."""
        assert self.output.restart_interval is not None
        return round(self.output.restart_interval / self.timestep)

    @field_validator("bond")
    @classmethod
    def _bonds_need_contact(cls, bond: Bond | None, info: ValidationInfo) -> Bond | None:
        if bond and _lacks_law_zohdi(info):
            raise ValueError("needs `contact` with `law: zohdi`")
        return bond

    @field_validator("near_field")
    @classmethod
    def _near_field_of_packed_particles(
        cls, near_field: NearField | None, info: ValidationInfo
    ) -> NearField | None:
        # Of particles from a file, signs and charges are known when they have been read.
        packed = info.data.get("particles")
        if near_field is None or not isinstance(packed, PackedParticles):
            return near_field
        if near_field.scaling == "charge" and packed.charge_per_mass == 0:
            text = "'charge' needs charged particles, and particles.charge_per_mass is 0"
            raise _InconsistentError((("scaling",), text))
        if _is_absent("contact", info):
            positive = packed.positive_count if near_field.scaling == "charge" else packed.count
            problem = near_field.divergence(positive, packed.count - positive)
            if problem:
                raise _InconsistentError(problem)
        return near_field

    @field_validator("time")
    @classmethod
    def _contacts_bear_trial_steps(cls, time: Time, info: ValidationInfo) -> Time:
        contact = info.data.get("contact")
        if time.integrator == "implicit" and contact is not None and contact.has_memory:
            raise _InconsistentError(
                (
                    ("integrator",),
                    f"'implicit' does not work with `contact.law: {contact.law}`"
                    f"{'' if contact.law == 'jkr' else ' and friction'}, whose contacts remember "
                    "what has been, and would remember steps that were only tried; take "
                    "`law: zohdi`, or `integrator: lorentz`",
                )
            )
        return time

    @field_validator("output")
    @classmethod
    def _output_of_the_case(cls, output: Output, info: ValidationInfo) -> Output:
        problems: list[_Problem] = []
        if output.contacts and _lacks_law_zohdi(info):
            problems.append((("contacts",), "needs `contact` with `law: zohdi`, got true"))
        time = info.data.get("time")
        if time is not None:
            output, interval_problems = _with_intervals(output, time)
            problems += interval_problems
        if problems:
            raise _InconsistentError(*problems)
        return output


def _lacks_law_zohdi(info: ValidationInfo) -> bool:
    """Tell whether a case has no contact of `law: zohdi`; an invalid one may be meant as such."""
    contact = info.data.get("contact")
    return _is_absent("contact", info) or (contact is not None and contact.is_stock)


def _with_intervals(output: Output, time: Time) -> tuple[Output, list[_Problem]]:
    """Return `output` with its intervals resolved to numbers, and what is wrong with them."""
    interval = output.interval or _in_steps(_part_of(time.steps, 100), time)
    frames = max(1, round(0.1 * time.duration / interval))
    intervals = {
        "interval": interval,
        "restart_interval": output.restart_interval or float(f"{frames * interval:.12g}"),
    }
    problems: list[_Problem] = [
        ((key,), f"must be a whole number of steps of {time.step!r}, got {interval!r}")
        for key, interval in intervals.items()
        if _whole_steps(interval, time.step) is None
    ]
    if intervals["interval"] > time.duration * (1 + WHOLE_STEPS_TOLERANCE):
        text = f"must be at most the duration {time.duration!r}, got {output.interval!r}"
        problems.append((("interval",), text))
    return output.model_copy(update=intervals), problems


def _whole_steps(length: float, step: float) -> int | None:
    """Return the number of steps in a length of time, None if it is not whole or out of range."""
    ratio = length / step
    if not 0.5 <= ratio <= MAX_STEPS:
        return None
    steps = round(ratio)
    return steps if abs(steps - ratio) <= WHOLE_STEPS_TOLERANCE * ratio else None


def _part_of(steps: int, parts: int) -> int:
    """Return about so many steps as go into a part, at least one; if it can be, a divisor."""
    wanted = max(1, round(steps / parts))
    for off in range(min(wanted // 2, DIVISORS_TRIED) + 1):
        for part in (wanted + off, wanted - off):
            if steps % part == 0:
                return part
    return wanted


def _in_steps(steps: int, time: Time) -> float:
    """Return a number of steps in s: 0.01, and not the 0.010000000000000002 of the product."""
    return float(f"{steps * time.step:.12g}")


def load_case(path: Path, *, of_run: Case | None = None) -> Case:
    """Read a case file.

    Parameters
    ----------
    path
        The file.
    of_run
        The case of a run that may have come from this file: its duration takes the place of the
        file's own, and its intervals of output that of those that the file leaves open.

    Raises
    ------
    CaseError
        If the file cannot be read or is not a valid case; it lists every problem.
    """
    path = Path(path)
    try:
        with open(path, "rb", opener=regular_files_only) as stream:
            content = stream.read(MAX_FILE_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise CaseError(f"{shown_path(path)}: cannot be read: {reason}") from None
    if len(content) > MAX_FILE_BYTES:
        raise CaseError(f"{shown_path(path)}: larger than {MAX_FILE_BYTES // 1024} KiB")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise CaseError(f"{shown_path(path)}: not a text file in UTF-8") from None
    content = _parse_yaml(text)
    if of_run is not None and isinstance(content, Mapping):
        content = _with_times_of(of_run, content)
    return parse_case(content, path.parent)


def _with_times_of(run: Case, content: Mapping[str, Any]) -> Mapping[str, Any]:
    sections = {key: content.get(key) or {} for key in ("time", "output")}
    if not all(isinstance(section, Mapping) for section in sections.values()):
        return content
    given = {key: value for key, value in sections["output"].items() if value is not None}
    kept = {key: getattr(run.output, key) for key in ("interval", "restart_interval")}
    time = {**sections["time"], "duration": run.time.duration}
    return {**content, "time": time, "output": kept | given}


def parse_case(source: str | Mapping[str, Any] | None, folder: Path) -> Case:
    """Check a case given as YAML text, or as the mapping that such a text stands for.

    Parameters
    ----------
    source
        The text or the mapping.
    folder
        Where a relative `particles.file` starts.

    Raises
    ------
    CaseError
        If it is not a valid case; it lists every problem.
    """
    content = _parse_yaml(source) if isinstance(source, str) else source
    if content is None:
        raise CaseError("the case is empty; it needs at least `name`, `particles` and `time`")
    if not isinstance(content, Mapping):
        raise CaseError(f"the case must be a mapping of keys to values, got {shown(content)}")
    try:
        return Case.model_validate(dict(content), context={"folder": Path(folder)})
    except ValidationError as error:
        problems = _problems(error)
        first = list(itertools.islice(problems, MAX_PROBLEMS))
        more = ["further problems are not listed"] if next(problems, None) else []
        raise CaseError(*first, *more) from None


def dump_case(case: Case) -> str:
    """Return a case as YAML with every default spelled out; it parses back to an equal case."""
    yaml = _yaml()
    # None writes the innermost collections on one line.
    yaml.default_flow_style = None
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    yaml.allow_unicode = True
    yaml.width = 4096
    stream = io.StringIO()
    yaml.dump(case.model_dump(mode="json"), stream)
    return stream.getvalue()


def _yaml() -> YAML:
    # The pure loader follows YAML 1.2, where 1e4 is a number and `no` is a word.
    return YAML(typ="safe", pure=True)


def _parse_yaml(text: str) -> Any:
    try:
        _check_structure(_yaml().parse(text))
        return _yaml().load(text)
    except CaseError:
        raise
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        what = _one_line(error.problem or error.context)
        raise CaseError(f"{where}not valid YAML: {what}") from None
    # The loader passes on what int() and others say of scalars such as a 5000-digit number.
    except (YAMLError, ValueError, OverflowError) as error:
        raise CaseError(f"not valid YAML: {_one_line(error)}") from None


def _check_structure(events: Iterator[Event]) -> None:
    """Refuse what is small as a text and huge or no plain value when it has been loaded."""
    depth = nodes = aliases = 0
    for event in events:
        where = f"line {event.start_mark.line + 1}, column {event.start_mark.column + 1}: "
        depth += isinstance(event, CollectionStartEvent) - isinstance(event, CollectionEndEvent)
        nodes += isinstance(event, NodeEvent)
        aliases += isinstance(event, AliasEvent)
        if depth > MAX_DEPTH:
            raise CaseError(f"{where}nested too deeply")
        if nodes > MAX_NODES:
            raise CaseError(f"{where}more than {MAX_NODES} values, too many for a case")
        if aliases > MAX_ALIASES:
            raise CaseError(f"{where}more than {MAX_ALIASES} aliases (such as *name)")
        if getattr(event, "tag", None) is not None:
            tag = _one_line(event.tag).replace("tag:yaml.org,2002:", "!!")
            raise CaseError(f"{where}a case file has no use for tags such as {tag}")


def _one_line(message: object) -> str:
    # Messages of the loader quote the file, which may hold escape sequences for a terminal.
    line = " ".join(str(message).split())[:200]
    return line if line.isprintable() else repr(line)


def _problems(error: ValidationError) -> Iterator[str]:
    """Yield every problem that pydantic found, in the words of the case file."""
    for detail in error.errors(include_url=False):
        location = detail["loc"]
        cause = detail.get("ctx", {}).get("error")
        if isinstance(cause, _InconsistentError):
            for key, text in cause.problems:
                yield f"{_key_path((*location, *key))}: {text}"
        elif detail["type"] == "invalid_key":
            location = (*location[:-1], str(location[-1]))
            yield f"{_key_path(location)}: a key must be text, got {shown(detail['input'])}"
        else:
            yield f"{_key_path(location)}: {_explanation(detail)}"


def _key_path(location: tuple[int | str, ...]) -> str:
    """Return `particles.packing.radius` or `fields.magnetic[2]` for a location of pydantic's."""
    path = ""
    for part in _without_tag(location):
        if isinstance(part, int):
            path += f"[{part}]"
        else:
            path += f".{part if part.isidentifier() and len(part) <= 60 else shown(part)}"
    return path.removeprefix(".")


def _without_tag(location: tuple[int | str, ...]) -> tuple[int | str, ...]:
    if location[:1] == ("particles",) and len(location) > 1:
        return (location[0], *location[2:])
    return location


_WHAT_IS_ALLOWED = {
    "model_type": "must be a section of keys and values",
    "model_attributes_type": "must be a section of keys and values",
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "int_from_float": "must be a whole number",
    "bool_type": "must be true or false",
    "string_type": "must be text (in quotes if it looks like a number or a date)",
    "finite_number": "must be a finite number, not infinity and not NaN",
    "greater_than": "must be greater than {gt:g}",
    "greater_than_equal": "must be at least {ge:g}",
    "less_than": "must be less than {lt}",
    "less_than_equal": "must be at most {le:g}",
    "literal_error": "must be {expected}",
    "string_pattern_mismatch": "must be 1 to 80 of the characters a-z, 0-9, _ and -",
    "string_too_long": "must be at most {max_length} characters long",
    "string_too_short": "must not be empty",
}


def _explanation(detail: Any) -> str:
    """Return what is allowed where one error of pydantic's occurred, and what was given."""
    location, kind = detail["loc"], detail["type"]
    if kind == "missing":
        section, key = location[:-1], str(location[-1])
        return f"missing, must be {_SECTIONS[section].model_fields[key].description}"
    if kind == "extra_forbidden":
        return _about_unknown_key(location)
    context = detail.get("ctx", {})
    if kind == "value_error":
        allowed = str(context["error"])
    else:
        allowed = _WHAT_IS_ALLOWED.get(kind, detail["msg"]).format(**context)
    if isinstance(detail["input"], dict) and kind == "value_error":
        return allowed
    return f"{allowed}, got {shown(detail['input'])}"


_SECTIONS: dict[tuple[int | str, ...], type[_Section]] = {
    (): Case,
    ("particles", "packed"): PackedParticles,
    ("particles", "packed", "packing"): Packing,
    ("particles", "file"): ParticlesFromFile,
    ("blast",): Blast,
    ("fields",): Fields,
    ("medium",): Medium,
    ("contact",): Contact,
    ("contact", "friction"): Friction,
    ("contact", "thermal"): Thermal,
    ("bond",): Bond,
    ("near_field",): NearField,
    ("near_field", "attraction"): PowerLaw,
    ("near_field", "repulsion"): PowerLaw,
    ("time",): Time,
    ("time", "implicit"): Implicit,
    ("output",): Output,
}


def _about_unknown_key(location: tuple[int | str, ...]) -> str:
    section, key = location[:-1], location[-1]
    if section == ("particles", "packed") and key in ParticlesFromFile.model_fields:
        return "goes with `particles.file` only"
    known = list(_SECTIONS[section].model_fields)
    nearest = difflib.get_close_matches(str(key), known, n=1)
    if nearest:
        return f"unknown key, did you mean `{nearest[0]}`?"
    return f"unknown key, known here: {', '.join(known)}"
