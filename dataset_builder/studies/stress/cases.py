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

MODULES = (light_cases, energy_cases, scale_cases, geometry_cases, mesh_cases, material_cases, glass_cases,
           number_cases, sum_cases, refused_cases)
CASES = tuple(found for module in MODULES for found in vars(module).values() if isinstance(found, Case))
