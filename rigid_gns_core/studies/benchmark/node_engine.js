// SPDX-FileCopyrightText: 2026 rigid_gns maintainers
// SPDX-License-Identifier: Apache-2.0

// The other end of `node_engine.py`: the first line of the input is a scene, each further one asks
// for a frame, which is answered with the centres, as doubles.

'use strict'

const { writeSync } = require('node:fs')
const { createInterface } = require('node:readline')

const answer = (array) => {
  const bytes = new Uint8Array(array.buffer)
  for (let done = 0; done < bytes.length; ) done += writeSync(1, bytes, done)
}

// `load` gives an engine by its package, `begin` a function that advances a scene of it by a frame
// and writes the centres into an array
exports.serve = async (load, begin) => {
  const engine = await load(process.argv[2])
  answer(new Float64Array(1)) // it is loaded
  let advance = null
  let places = null
  for await (const line of createInterface({ input: process.stdin })) {
    if (advance === null) {
      const scene = JSON.parse(line)
      places = new Float64Array(3 * scene.positions.length)
      advance = begin(engine, scene)
      answer(new Float64Array(1))
    } else {
      advance(places)
      answer(places)
    }
  }
}
