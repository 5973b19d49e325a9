"""FMUs of another tool: an oscillator in C written for these tests, and descriptions of what it could be."""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path

SOURCE = """
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
typedef struct { double t, x[2], u, J, c, d; } Unit;
static double torque(Unit *m) { return LAW; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
void *fmi2Instantiate(const char *n, int k, const char *g, const char *r, const void *b, int v, int l)
{ Unit *m = calloc(1, sizeof(Unit)); m->J = 2; m->c = 50; m->d = 0.5; m->x[1] = 1.0; return m; }
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetDebugLogging(void *c, int a, size_t n, const char **s) { return 0; }
int fmi2SetupExperiment(void *c, int a, double t, double s, int b, double e) { ((Unit *)c)->t = s; return 0; }
int fmi2EnterInitializationMode(void *c) { return 0; }
int fmi2ExitInitializationMode(void *c) { return 0; }
int fmi2Terminate(void *c) { return 0; }
int fmi2Reset(void *c) { return 0; }
static double *at(Unit *m, unsigned r)
{ double *all[] = {0, &m->x[0], &m->x[1], 0, 0, &m->u, &m->J, &m->c, &m->d}; return r < 9 ? all[r] : 0; }
static double rate(Unit *m, unsigned k) { return k == 0 ? TWIST : torque(m) / m->J; }
int fmi2GetReal(void *c, const unsigned *r, size_t n, double *v)
{ Unit *m = c; for (size_t i = 0; i < n; i++) { double *p = at(m, r[i]);
  v[i] = p ? *p : r[i] == 9 ? -torque(m) : rate(m, r[i] - 3); } return 0; }
int fmi2SetReal(void *c, const unsigned *r, size_t n, const double *v)
{ for (size_t i = 0; i < n; i++) { double *p = at(c, r[i]); if (!p) return 3; *p = v[i]; } return 0; }
#define NO(F) int F(void) { return 3; }
NO(fmi2GetInteger) NO(fmi2GetBoolean) NO(fmi2GetString) NO(fmi2SetInteger) NO(fmi2SetBoolean) NO(fmi2SetString)
NO(fmi2GetFMUstate) NO(fmi2SetFMUstate) NO(fmi2FreeFMUstate) NO(fmi2SerializedFMUstateSize) NO(fmi2SerializeFMUstate)
NO(fmi2DeSerializeFMUstate) NO(fmi2GetDirectionalDerivative)
int fmi2EnterEventMode(void *c) { return 0; }
int fmi2NewDiscreteStates(void *c, int *e) { memset(e, 0, 32); return 0; }
int fmi2EnterContinuousTimeMode(void *c) { return 0; }
int fmi2CompletedIntegratorStep(void *c, int a, int *e, int *t) { *e = *t = 0; return 0; }
int fmi2SetTime(void *c, double t) { ((Unit *)c)->t = t; return FAILS; }
int fmi2SetContinuousStates(void *c, const double *x, size_t n) { memcpy(((Unit *)c)->x, x, 8 * n); return 0; }
int fmi2GetDerivatives(void *c, double *d, size_t n) { for (size_t i = 0; i < n; i++) d[i] = rate(c, i); return 0; }
int fmi2GetEventIndicators(void *c, double *z, size_t n) { return 0; }
int fmi2GetContinuousStates(void *c, double *x, size_t n) { memcpy(x, ((Unit *)c)->x, 8 * n); return 0; }
int fmi2GetNominalsOfContinuousStates(void *c, double *x, size_t n)
{ for (size_t i = 0; i < n; i++) x[i] = 1; return 0; }
"""

_PARAMETER = '<ScalarVariable name="{}" valueReference="{}" causality="parameter" variability="fixed">'
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="unit" guid="{{1}}" numberOfEventIndicators="{indicators}">
<{kind} modelIdentifier="unit"/>
<ModelVariables>
<ScalarVariable name="twist" valueReference="1" initial="exact"><Real start="0"/></ScalarVariable>
<ScalarVariable name="w1" valueReference="2" causality="{speed}" initial="exact"><Real start="1"/></ScalarVariable>
<ScalarVariable name="der(twist)" valueReference="3"><Real derivative="1"/></ScalarVariable>
<ScalarVariable name="der(w1)" valueReference="4"><Real derivative="2"/></ScalarVariable>
<ScalarVariable name="u" valueReference="5" causality="input"><Real start="0"/></ScalarVariable>
{J}<Real start="2"/></ScalarVariable>
{c}<Real start="50"/></ScalarVariable>
{d}<Real start="0.5"/></ScalarVariable>
<ScalarVariable name="tau" valueReference="9" causality="{torque}"><Real/></ScalarVariable>
</ModelVariables>
<ModelStructure>
<Outputs><Unknown index="{output}"{dependencies}/></Outputs>
<Derivatives><Unknown index="3"/><Unknown index="4"/></Derivatives>
<InitialUnknowns><Unknown index="3"/><Unknown index="4"/>{unknown}</InitialUnknowns>
</ModelStructure>
</fmiModelDescription>
"""

SPRING = {
    "LAW": "m->c * m->x[0] + m->d * (m->u - m->x[1])",
    "TWIST": "m->u - m->x[1]",
}
"""An inertia behind a spring and a damper: u is the speed of the other end, tau the torque on it."""
INERTIA = {"LAW": "m->u", "TWIST": "m->x[1]"}
"""An inertia on which u is a torque."""
TORQUE = {"speed": "local", "torque": "output", "output": "9", "dependencies": "", "unknown": '<Unknown index="9"/>'}
SPEED = {"speed": "output", "torque": "local", "output": "2", "dependencies": ' dependencies="2"', "unknown": ""}


def zipped(path: Path, **says: str) -> Path:
    """An FMU without a binary.

    Args:
        path: of the file.
        **says: what its description says, `TORQUE` or `SPEED`, and its kind and number of indicators.
    """
    words = {"kind": "ModelExchange", "indicators": "0", **says}
    words |= {name: _PARAMETER.format(name, number) for number, name in enumerate("Jcd", 6)}
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION.format(**words))
    return path


def built(path: Path, laws: dict[str, str], fails: str = "0", **says: str) -> Path:
    """An FMU with a binary for this machine.

    Args:
        path: of the file.
        laws: `SPRING` or `INERTIA`.
        fails: the status of setTime, an expression of the time t.
        **says: as of `zipped`.
    """
    zipped(path, **says)
    source, binary = path.with_suffix(".c"), path.with_suffix(".so")
    source.write_text(SOURCE)
    laws = {**laws, "FAILS": fails}
    options = [f"-D{name}={text}" for name, text in laws.items()]
    subprocess.run(["gcc", "-w", "-shared", "-fPIC", *options, str(source), "-o", str(binary)], check=True)
    with zipfile.ZipFile(path, "a") as archive:
        archive.write(binary, "binaries/linux64/unit.so")
    return path
