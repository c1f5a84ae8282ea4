from vtkmuscle.core.mesh.shared import RecentlyUsed


def test_what_was_asked_for_last_is_kept_and_the_rest_is_found_again():
    asked = []

    def find(key):
        return lambda: asked.append(key) or key

    recent = RecentlyUsed(2)
    for key in "aabacab":
        assert recent(key, find(key)) == key
    assert asked == ["a", "b", "c", "b"]
