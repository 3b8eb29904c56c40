#pragma once
#include <map>
#include <tuple>
#include <vector>

#include "jacket/Island.h"

namespace jacket {

/// A step taken in parts, for contacts with fast bodies that do not settle in one: a sheet that comes down past the
/// edges of something thin would go many times its thickness, and end with most of its triangles cut through. From
/// outside it is still one step. The shells keep their positions until Shell::advance, which moves them to where the
/// last part ends.
class StepParts {
  public:
    /// `failed`: what the attempt at the whole step cost. `whole` must outlive this.
    StepParts(const IslandInput& whole, const StepReport& failed);
    ~StepParts();
    /// Whether a step may be taken in parts: the couplings of free bodies are known for whole steps only.
    static bool areAllowed(const IslandInput& whole);

    const IslandInput& next() const { return m_part; }
    /// Whether the next part may.
    bool mayBeShorter() const { return m_length > 1; }
    /// After an attempt at it that came to nothing.
    void shorten(const StepReport& failed);
    /// After the next part was solved and stored.
    void add(const StepReport& solved);
    bool areDone() const { return m_ticks == kTicks || !m_sum.finite; }
    /// Of the whole step.
    const StepReport& report() const { return m_sum; }

  private:
    static constexpr int kTicks = 16;  ///< that the shortest parts would be
    struct Start {
        Points x, v;
        std::map<int, Vec3> pinTargets;
    };
    void begin();
    void moveBodies();
    void addContact(const ContactImpulse& one);

    const IslandInput& m_whole;
    IslandInput m_part;
    std::vector<Start> m_start;  ///< of each shell
    std::vector<CoupledBody> m_bodies;
    std::vector<std::vector<BodySupport>> m_supports;  ///< of each body
    std::vector<RigidContact> m_rigidContacts;
    std::vector<Anchor> m_anchors;
    int m_ticks = 0;        ///< that are done
    int m_length = kTicks;  ///< of the next part
    StepReport m_sum;
    std::map<std::tuple<int, int, int>, std::size_t> m_contacts;  ///< of shell, body and feature: index in the report
};

}  // namespace jacket
