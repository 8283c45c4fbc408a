"""Every hard case, in reading order."""

from dataset_builder.studies.stress import (
    energy_cases,
    geometry_cases,
    glass_cases,
    light_cases,
    material_cases,
    mesh_cases,
    number_cases,
    refused_cases,
    scale_cases,
    sum_cases,
)
from dataset_builder.studies.stress.case import Case

CASES: tuple[Case, ...] = (
    *light_cases.CASES, *energy_cases.CASES, *scale_cases.CASES, *geometry_cases.CASES, *mesh_cases.CASES,
    *material_cases.CASES, *glass_cases.CASES, *number_cases.CASES, *sum_cases.CASES,
    *refused_cases.CASES,
)
