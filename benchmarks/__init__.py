"""Our speed beside that of peers, both in one run.

A benchmark is one module of this package. It says what is compared, makes the input, and has one
function for each contender::

    TITLE = "Sorting a million numbers"

    def prepare(folder: Path) -> None:
        "Writes the input that all contenders read; runs once, with the project's Python."
        np.save(folder / "numbers.npy", np.random.default_rng(0).uniform(size=1_000_000))

    def ours(folder: Path) -> Results:
        "Returns samples for each case; runs in a process of its own."
        numbers = np.load(folder / "numbers.npy")
        return {"random order": Samples(time_calls(lambda: np.sort(numbers)), "s")}

    def peer(folder: Path) -> Results:
        import polars  # Imports of a peer stand inside its function: it has its own environment.
        ...

    CONTENDERS = (
        Contender("prehensile", ours),  # The first one is ours.
        Contender("Polars", peer, requirements=("polars==1.35", "numpy")),
    )

A contender without requirements runs with the project's Python; one with requirements runs in a
virtual environment under ``build/peers``, which is made when it is first needed. A peer that cannot
be installed or fails is reported, and the rest goes on. Contenders take turns for several rounds;
what is printed is the median over the rounds, and the median of the rounds' ratios, so that a slow
moment of the machine hits both sides.

At the top, a benchmark module imports nothing but the standard library, NumPy and
``benchmarks.framework``. Run it by ``prehensile bench NAME``.
"""
