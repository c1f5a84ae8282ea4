"""Filters over time asked for any sequence of times, with any changes between them."""

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st


def check_sequences(choices, times, made, put, check_frame, *, examples, longest):
    """Ask new chains for sequences of times and changes.

    choices : values of all that may change, by name, that of the first request first;
    made(state) : return a chain, state is values by name;  put(chain, name, value) : change it;
    check_frame(chain, state, time) : fail where a frame is not that of a fresh chain.
    """
    changes = st.sampled_from([(name, value) for name, values in choices.items() for value in values])
    asked = st.sampled_from(times)
    sequences = st.lists(st.one_of(asked, asked, changes), min_size=2, max_size=longest)

    @settings(max_examples=examples, deadline=None, suppress_health_check=[HealthCheck.too_slow])
    @given(sequences.filter(lambda entries: any(isinstance(entry, float) for entry in entries)))
    def check(sequence):
        state = {name: values[0] for name, values in choices.items()}
        chain = made(state)
        for entry in sequence:
            if isinstance(entry, float):
                check_frame(chain, state, entry)
            else:
                state[entry[0]] = entry[1]
                put(chain, *entry)
                if entry[0] == "quality":  # it sets others, too
                    for name, value in state.items():
                        put(chain, name, value)

    check()
