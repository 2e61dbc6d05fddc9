globalThis.cradle = { collide, outcome, largestRatios, largestCommonRatio, shown };
