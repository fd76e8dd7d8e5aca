// Quantised batches as the buffers of a compute-shader renderer: a structured buffer of records, and one buffer of 32-bit words per
// plane and for the colours. Where it says "buffer", an engine makes a ComputeBuffer (stride 32, stride 4) and uploads it.

using System;
using System.Collections.Generic;

namespace Pointmill.Examples
{
    public sealed class BatchBuffers : IDisposable
    {
        private readonly Dataset dataset;
        private Draw[] list;

        /// <summary>Number of batches: a thread group each.</summary>
        public int Batches { get; private set; }
        public long Points { get; private set; }
        /// <summary>Bits of a position: 10, 20 or 30; so there are 1, 2 or 3 planes.</summary>
        public int Bits { get; private set; }
        /// <summary>What records and positions are relative to, in the axes of the file: (x, y, z) with z up.</summary>
        public Vector3d Origin { get; private set; }

        public BatchBuffers(string path)
        {
            dataset = Dataset.Open(path, Axes.ZUp);
            Info info = dataset.Info;
            if (info.Kind != Kind.Batches) throw new ArgumentException("these are no quantised batches", "path");
            Batches = (int)info.Nodes;
            Points = (long)info.Points;
            Bits = (int)info.Bits;
            Origin = info.GridOrigin;
        }

        /// <summary>8 words per batch: 3 floats, first point, 3 floats, number of points.</summary>
        public int[] Records()
        {
            using (MappedSection section = dataset.MapSection(Section.Records))
            {
                int[] words = new int[section.Bytes / 4];
                section.CopyWords(0, words, 0, words.Length);
                return words;
            }
        }

        /// <summary>
        /// The words of a plane or of the colours, one per point, a piece at a time: no piece has more words than the buffer, which
        /// is used again. upload gets the buffer, its length, and the index of its first word. Compressed files are decoded.
        /// </summary>
        public void Upload(Section section, int[] buffer, Action<int[], int, long> upload)
        {
            if (dataset.Info.IsCompressed)
            {
                byte[] bytes = new byte[4 * 10240];
                for (int slot = 0; slot < Batches; slot++)
                {
                    int count = dataset.ReadBatchSection((uint)slot, section, 0, bytes) / 4;
                    Buffer.BlockCopy(bytes, 0, buffer, 0, 4 * count);
                    upload(buffer, count, 10240L * slot);
                }
                return;
            }
            using (MappedSection mapped = dataset.MapSection(section))
            {
                // With Unity's NativeArray the mapped memory itself can be uploaded: mapped.Pointer, mapped.Bytes.
                long words = mapped.Bytes / 4;
                for (long first = 0; first < words; first += buffer.Length)
                {
                    int count = (int)Math.Min(buffer.Length, words - first);
                    mapped.CopyWords(first, buffer, 0, count);
                    upload(buffer, count, first);
                }
            }
        }

        /// <summary>Levels of detail of a batch that is dMin away which a compute shader would keep a point of: 0 to 4.</summary>
        public int Levels(double dMin, float clod)
        {
            return Library.ClodLevels(dMin, clod, (float)dataset.Info.GridCell);
        }

        /// <summary>True if the shader keeps a point in the middle of the picture; level: the top byte of its colour word.</summary>
        public bool Keeps(uint index, uint level, float distance, float clod)
        {
            float spacing = Library.ClodSpacing(distance, clod, 0);
            return Library.ClodKeeps(level, Library.ClodWeight(index), (float)dataset.Info.GridCell, spacing);
        }

        /// <summary>The batches in sight, the nearest first, and the bits that each needs: what a cull pass would find.</summary>
        public List<KeyValuePair<uint, uint>> Visible(Camera camera, ulong budget)
        {
            Selection selection = new Selection { Budget = budget };
            int count = dataset.Select(ref camera, ref selection, ref list);
            List<KeyValuePair<uint, uint>> visible = new List<KeyValuePair<uint, uint>>(count);
            for (int i = 0; i < count; i++) visible.Add(new KeyValuePair<uint, uint>(list[i].Node, list[i].Bits));
            return visible;
        }

        public void Dispose() { dataset.Dispose(); }
    }
}
