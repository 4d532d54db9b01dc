# `__init__.py` imports each of these public names when it is first used. Type checkers read the names here.
from . import (
    areas as areas,
    digital as digital,
    identification as identification,
    optimal as optimal,
    plant as plant,
    plots as plots,
    reduction as reduction,
    robustness as robustness,
    rules as rules,
)
from ._version import __version__ as __version__
from .comparison import Comparison as Comparison, compare as compare
from .comparison.benchmarking import Benchmark as Benchmark, benchmark as benchmark
from .controllers import (
    PIDA as PIDA,
    HighOrderPID as HighOrderPID,
    NonInteractivePIDA as NonInteractivePIDA,
    SeriesPIDA as SeriesPIDA,
)
from .loop import Loop as Loop
from .plant import (
    Check as Check,
    Record as Record,
    Report as Report,
    check as check,
    heater as heater,
    report as report,
    tune as tune,
)
from .process import (
    AsymmetricPlant as AsymmetricPlant,
    Process as Process,
    fopdt as fopdt,
    ipdt as ipdt,
    lags as lags,
    sopdt as sopdt,
)
from .relative_noise import (
    NoiseScale as NoiseScale,
    noise_scale as noise_scale,
    relative_noise_gain as relative_noise_gain,
)
from .response import Response as Response
from .robustness.margins import (
    Margins as Margins,
    bandwidth as bandwidth,
    gain_crossovers as gain_crossovers,
    gain_for_ms as gain_for_ms,
    margins as margins,
    max_sensitivity as max_sensitivity,
    phase_crossovers as phase_crossovers,
)
from .robustness.poles import (
    is_stable as is_stable,
    rightmost_poles as rightmost_poles,
    unstable_poles as unstable_poles,
)
from .rules import Design as Design
from .simulation.exact import (
    load_response as load_response,
    open_loop_step as open_loop_step,
    simulate as simulate,
    simulate_ensemble as simulate_ensemble,
    step_response as step_response,
)
from .simulation.portrait import Portrait as Portrait, portrait as portrait
from .simulation.sampled import (
    noise_gain as noise_gain,
    simulate_sampled as simulate_sampled,
    uniform_noise as uniform_noise,
)
