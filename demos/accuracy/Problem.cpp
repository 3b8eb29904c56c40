#include "accuracy/Problem.h"

#include "accuracy/Setup.h"

namespace jacket::demo::accuracy {

std::span<const Problem> problems() {
    static const std::vector<Problem> all = [] {
        std::vector<Problem> list;
        addStrips(list);
        addPlates(list);
        addFrequencies(list);
        addBuckling(list);
        addCurvedShells(list);
        return list;
    }();
    return all;
}

}  // namespace jacket::demo::accuracy
