"""The LAMMPS commands for what particles do to each other: pair styles and their coefficients."""

from __future__ import annotations

from dataclasses import dataclass

from lammps_blast.case import Bond, Case, Contact, NearField
from lammps_blast.particles import Particles

CONTACT_STYLE, NEAR_FIELD_STYLE, STOCK_STYLE = "blast/contact", "blast/nearfield", "granular"
# Of the property that holds the signs c of eq. 7.23, where some are negative.
SIGN_PROPERTY = "i_sign"
SIGN_FIX, SIGN_SECTION = "signs", "Signs"


@dataclass(frozen=True)
class PairStyle:
    """One pair style: its name, its settings, and what `pair_coeff` says of all types."""

    name: str
    settings: str
    coefficients: str


def pair_styles(case: Case, particles: Particles) -> list[PairStyle]:
    """Return the pair styles of a case, none if its particles do not interact."""
    styles = []
    if case.contact:
        styles.append(_stock_style(case.contact) if case.contact.is_stock else _contact(case))
    if case.near_field:
        styles.append(_near_field(case.near_field, uses_signs(case, particles)))
    return styles


def pair_commands(styles: list[PairStyle]) -> str:
    """Return the commands that set up pair styles, overlaid where there are several."""
    if not styles:
        return ""
    if len(styles) == 1:
        (only,) = styles
        lines = [f"pair_style {only.name} {only.settings}".rstrip()]
        lines.append(f"pair_coeff * * {only.coefficients}")
    else:
        together = " ".join(f"{style.name} {style.settings}".rstrip() for style in styles)
        lines = [f"pair_style hybrid/overlay {together}"]
        lines += [f"pair_coeff * * {style.name} {style.coefficients}" for style in styles]
    return "\n".join(lines) + "\n"


def uses_signs(case: Case, particles: Particles) -> bool:
    """Tell whether the near field needs signs that LAMMPS cannot take from the charges."""
    field = case.near_field
    return field is not None and field.scaling != "charge" and bool((particles.sign < 0).any())


def number(value: float) -> str:
    """Return a number as LAMMPS reads it back to the last bit."""
    return repr(float(value))


def numbers(*values: float) -> str:
    """Return numbers separated by blanks."""
    return " ".join(number(value) for value in values)


def _contact(case: Case) -> PairStyle:
    contact = case.contact
    words = f"stiffness {number(contact.stiffness)} exponent {number(contact.exponent)}"
    words += f" damping {number(contact.damping)}"
    if friction := contact.friction:
        words += f" friction {numbers(friction.stiffness, friction.static, friction.dynamic)}"
    if thermal := contact.thermal:
        words += f" thermal {numbers(*thermal.softening)}"
    if case.bond:
        words += f" {_bond_words(case.bond)}"
    rotation = "yes" if contact.rotation else "no"
    return PairStyle(CONTACT_STYLE, f"rotation {rotation}", words)


def _bond_words(bond: Bond) -> str:
    values = bond.stiffness, bond.exponent, bond.activation_strain, bond.tangential_stiffness
    return f"bond {numbers(*values)} {bond.memory}"


def _near_field(field: NearField, signs: bool) -> PairStyle:
    cutoff = "all" if field.cutoff == "all" else number(field.cutoff)
    settings = f"{cutoff} {field.scaling}"
    if field.switch_width:
        settings += f" switch {number(field.switch_width)}"
    if signs:
        settings += f" signs {SIGN_PROPERTY}"
    if field.accuracy:
        settings += f" method {field.method} accuracy {number(field.accuracy)}"
    terms = [
        numbers(term.strength, term.exponent) if term else numbers(0.0, 0.0)
        for term in (field.attraction, field.repulsion)
    ]
    return PairStyle(NEAR_FIELD_STYLE, settings, " ".join(terms))


def _stock_style(contact: Contact) -> PairStyle:
    """Return the laws of appendix B.2 as LAMMPS has them."""
    damping = number(contact.damping)
    if contact.law == "hooke":
        normal = f"hooke {number(contact.stiffness)} {damping}"
    else:
        law = "hertz/material" if contact.law == "hertz" else contact.law
        normal = f"{law} {number(contact.youngs_modulus)} {damping} {number(contact.poisson_ratio)}"
    if contact.surface_energy:
        normal += f" {number(contact.surface_energy)}"
    return PairStyle(STOCK_STYLE, "", f"{normal} damping velocity {_stock_friction(contact)}")


def _stock_friction(contact: Contact) -> str:
    friction = contact.friction
    if friction is None:
        return "tangential linear_nohistory 0.0 0.0"
    if contact.law == "hooke":
        return f"tangential linear_history {numbers(friction.stiffness, 0.0, friction.static)}"
    return f"tangential mindlin NULL {numbers(0.0, friction.static)}"
